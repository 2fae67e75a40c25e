"""A claim that is checked again, and how near a number has to come to be the one claimed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any, Literal

import numpy as np

SLACK = 1e-7
"""How far a number that is computed anew may be from the one that is held, relative: a hundredth of
the bracket's width that counts as certified. The same processor gives the same digits; others round
otherwise, and then a solver that finds a state to refer to stops elsewhere."""

RESIDUAL = 1e-6
"""Residual of equilibrium over the total load, beyond which forces are not those of a solver: they
leave 1e-10 as a rule; this is a tenth of the width that counts as certified."""

Kind = Literal["proved", "derived", "not looked at"]


@dataclass(frozen=True)
class Check:
    """One claim, and whether it holds; ``found`` says from what, or why not.

    Attributes
    ----------
    claim : str
    is_met : bool
        False if it does not hold. What was not looked at claims nothing, and so is not false.
    found : str
    kind : {"proved", "derived", "not looked at"}
        Whether forces, mechanisms or displacements prove the claim, whether it follows from the
        scene and from what is proved, or whether nobody has checked it.
    """

    claim: str
    is_met: bool
    found: str = ""
    kind: Kind = "proved"

    def __str__(self) -> str:
        found = f" ({self.found})" if self.found else ""
        return f"{self.claim}: {self.kind if self.is_met else 'NOT proved'}{found}"


def proved(claim: str, is_met: bool, but: str, by: str = "") -> Check:
    """A claim that is proved ``by`` something, or is not: ``but`` says what was found instead."""
    return Check(claim, is_met, by if is_met else but)


def follows(claim: str, is_met: bool, but: str, by: str = "") -> Check:
    """A claim that follows from the scene and from what is proved, or does not, as above."""
    return Check(claim, is_met, by if is_met else but, "derived")


def unseen(claim: str, why: str = "") -> Check:
    """What was not looked at."""
    return Check(claim, True, why, "not looked at")


def unseen_fields(held: Any, seen: Collection[str]) -> Iterator[Check]:
    """The fields of a dataclass that say something, and were not looked at."""
    for each in fields(held):
        usual = each.default if each.default_factory is MISSING else each.default_factory()
        if each.name not in seen and not is_alike(getattr(held, each.name), usual):
            yield unseen(each.name)


def is_alike(held: Any, found: Any) -> bool:
    """True for what is the same, numbers within :data:`SLACK` of it."""
    if is_dataclass(held) and type(held) is type(found):
        return all(is_alike(getattr(held, f.name), getattr(found, f.name)) for f in fields(held))
    if isinstance(held, float) and isinstance(found, float):
        return held == found or bool(abs(held - found) <= SLACK * max(abs(held), abs(found)))
    if isinstance(held, np.ndarray):
        return np.array_equal(held, found)
    return bool(held == found)

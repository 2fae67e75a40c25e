"""A claim that is checked again, how near a number has to come, and the walk over what is held.

Every entry of what is held is one of three: it proves others, it is found anew, or it is named.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
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


def compared(
    held: Any, found: Mapping[str, Any], told: Collection[str] = (), near: float = SLACK
) -> Iterator[Check]:
    """Every entry of a record or a mapping that is held, but for those ``told`` otherwise, which
    prove others or are claims of their own: it follows if it is as it was ``found`` anew, numbers
    ``near`` it; what nobody found is named if it says something."""
    names = held if isinstance(held, Mapping) else [each.name for each in fields(held)]
    for name in (name for name in names if name not in told):
        own = held[name] if isinstance(held, Mapping) else getattr(held, name)
        if name not in found:
            yield from [unseen(name)] if says(own) else []
        elif says(own) or says(found[name]):
            claim = f"{name} {own!r:.60}" if isinstance(own, str | int | float) else name
            yield follows(claim, is_alike(own, found[name], near), f"it is {found[name]!r:.80}")


def says(value: Any) -> bool:
    """False for what is none, empty, nothing or zero."""
    return len(value) > 0 if isinstance(value, np.ndarray) else bool(value)


def is_alike(held: Any, found: Any, near: float = SLACK) -> bool:
    """True for what is the same, numbers within so much of it."""
    if is_dataclass(held) and type(held) is type(found):
        pairs = ((getattr(held, f.name), getattr(found, f.name)) for f in fields(held))
        return all(is_alike(own, other, near) for own, other in pairs)
    if isinstance(held, float | np.ndarray) and isinstance(found, float | np.ndarray):
        is_near = np.isclose(held, found, near, 0.0, equal_nan=True)
        return np.shape(held) == np.shape(found) and bool(is_near.all())
    return bool(held == found)

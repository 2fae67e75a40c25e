"""A claim that is checked again, and how near a number has to come to be the one claimed."""

from __future__ import annotations

from dataclasses import dataclass

SLACK = 1e-7
"""How far a number that is computed anew may be from the one that is held, relative: a hundredth of
the bracket's width that counts as certified. The same processor gives the same digits; others round
otherwise, and then a solver that finds a state to refer to stops elsewhere."""

RESIDUAL = 1e-6
"""Residual of equilibrium over the total load, beyond which forces are not those of a solver: they
leave 1e-10 as a rule; this is a tenth of the width that counts as certified."""


@dataclass(frozen=True)
class Check:
    """One claim, and whether it holds; ``found`` says from what, or why not."""

    claim: str
    is_met: bool
    found: str = ""

    def __str__(self) -> str:
        found = f" ({self.found})" if self.found else ""
        return f"{self.claim}: {'proved' if self.is_met else 'NOT proved'}{found}"

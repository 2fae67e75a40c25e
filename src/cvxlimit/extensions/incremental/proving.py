"""What can be proved again of a load factor reached from rest: what the method adds at
``cvxlimit.checks``.

It is no bound. Its forces carry the load factor, and no joint slides or rocks beyond what it bears;
the way to them is not gone again, and is named as not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator

from cvxlimit.proof.checks import RESIDUAL, Check, proved
from cvxlimit.proof.strength import Strength
from cvxlimit.proving.again import ProvedAgain
from cvxlimit.solution import Status
from cvxlimit.surfaces import Rocking, Sliding


def checks(again: ProvedAgain) -> Iterator[Check]:
    """Equilibrium, and friction and pressure of joints as they stand; torsion is held at points,
    whose friction no resultant shows."""
    if again.solution.status is Status.DEAD_LOAD_UNSTABLE:
        yield again.falls()
        return
    yield from again.held_checks()
    forces = again.by.forces
    if forces is None or not again.is_finite:
        return
    strength = Strength(again.run.assemblage, (Rocking(), Sliding()))
    beyond = float(strength.excess(forces).max(initial=0.0))
    beyond /= again.run.scaling.force
    said = f"at most {beyond:.1e} of the total load beyond"
    yield proved("joints bear the forces", beyond <= RESIDUAL, said, "within friction and contact")

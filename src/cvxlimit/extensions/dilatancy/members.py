"""Solutions without dilatancy, checked in NumPy outside any solver."""

from __future__ import annotations

import numpy as np

from cvxlimit.geometry.contacts import COLUMN
from cvxlimit.methods.driver import Run
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.flow import corner_openings
from cvxlimit.proof.tresca import HeldFlow
from cvxlimit.solution import Member
from cvxlimit.solvers import LimitState
from cvxlimit.surfaces.coulomb import needed_surfaces


class Verifier:
    """Checks of solutions without dilatancy.

    Forces must balance the loads inside all surfaces. The mechanism must be one of the flow rule
    with friction held at the forces' own compressions: joints slide without opening, and stone
    crushes, mortar tears and ties yield as that rule has it. What friction, cohesion and strength
    take up of power is known from the rates, and forces must do it, contact by contact: what they
    lack adds up to the loss of :mod:`~cvxlimit.extensions.dilatancy.pair`. Where friction
    ``has_cones`` it may lie at an angle to the slip, which is told: it costs the square of the
    angle only.
    """

    def __init__(
        self, run: Run, certifier: Certifier | None = None, slip: HeldFlow | None = None,
        has_cones: bool = True,
    ) -> None:  # fmt: skip
        self.has_cones = has_cones
        self.statics, self.contacts = run.assemblage.statics, run.assemblage.contacts
        self.least = run.scaling.least
        surfaces = needed_surfaces(run.surfaces)
        self.certifier = certifier or Certifier(run.assemblage, surfaces)
        self.strength = self.certifier.strength
        # A flow rule of resultants does not know the cells that internal forces act on.
        if slip is None or self.strength.is_internal:
            slip = HeldFlow(surfaces, self.strength.model)
        self.slip = slip

    def member(self, state: LimitState, start: str, iterations: int) -> Member | None:
        """Returns a solver's forces, balanced, and its mechanism, scaled to live power 1, with all
        their residuals; None without forces or without live power.

        ``start`` says where the search began, ``iterations`` how many problems it solved.
        """
        internal, alpha = self.certifier.given(state), state.load_factor
        if internal is None or state.mechanism is None or alpha is None:
            return None
        live = float(self.statics.live @ state.mechanism.ravel())
        if not live > 0.0:
            return None
        # The mechanism at live power 1, and forces in equilibrium with the loads.
        mechanism = state.mechanism / live
        balanced = self.strength.balanced(internal, alpha, self.statics)
        forces = self.strength.forces(balanced)
        rates = self.statics.relative_rates(mechanism)
        # Complementarity: at each contact the power of the forces (negative where they resist) and
        # the power that friction, cohesion and strength take up cancel out. What compressions do
        # where blocks penetrate is lost by itself: friction that slips the wrong way would make up
        # for it, and blocks that wedge each other press so hard that little of either tells.
        shortfall, pressed = self.slip.shortfall(rates), forces[:, COLUMN["N"]]
        friction = self.slip.dilatancy(shortfall) * pressed
        taken = friction + shortfall.by_contact
        closed = np.abs(pressed) * np.maximum(shortfall.missing, 0.0)
        lost = float((np.abs((forces * rates).sum(axis=1) + taken) + closed).sum())
        # Flow: rates that no condition resists, or missing openings, over the largest rate.
        openings = corner_openings(rates, self.contacts)
        penetrates = float(np.abs(shortfall.unresisted).max(initial=shortfall.missing.max()))
        largest = float(max(np.abs(openings).max(), np.abs(rates[:, :2]).max()))
        equilibrium, excess = self.certifier.residuals(balanced, alpha)
        size, power = max(abs(alpha), self.least), float(friction.sum())
        return Member(
            load_factor=alpha,
            start=start,
            iterations=iterations,
            equilibrium=equilibrium,
            yield_excess=excess,
            flow=max(penetrates, 0.0) / largest,
            complementarity=lost / size,
            forces=forces,
            mechanism=mechanism,
            angle=_angle(lost, power, size) if self.has_cones else 0.0,
        )


def _angle(lost: float, friction: float, size: float) -> float:
    """Returns the angle to the slip at which friction that could do so much power loses some, times
    its share of a power's ``size`` where that is less than all: joints that slip by rounding, or
    press by no more, tell nothing of the load factor, at whatever angle."""
    if friction <= 0.0:
        return 0.0
    return float(np.arccos(1.0 - min(lost / friction, 1.0))) * min(friction / size, 1.0)

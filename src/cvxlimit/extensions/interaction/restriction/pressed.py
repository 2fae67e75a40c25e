"""Eq. 30 with eccentricities frozen, and contacts pressed where it then allows no less.

Forces are admissible, so that the load factor is a lower bound, as far as its solver is exact.
"""

from __future__ import annotations

from dataclasses import replace

from cvxlimit.extensions.interaction.states.states import states_of
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.methods.frozen import FrozenProblem
from cvxlimit.model.formulations import ForceModel, resultants
from cvxlimit.readings.pressure import Pressure, half_extent
from cvxlimit.surfaces.frozen import Frozen, Pressed


def pressed_resultants(contacts: Contacts) -> ForceModel:
    """The six components of each contact as internal forces, with N >= 0. Rocking need not be
    stated: :class:`~cvxlimit.surfaces.frozen.Pressed` keeps the pressure centre, and with it M1 and
    M2 over N, within the contact."""
    model = resultants(contacts)
    parts = [replace(part, nonneg=part.name == "N") for part in model.parts]
    return replace(model, parts=parts, implied=frozenset({"rocking"}))


class PressedProblem(FrozenProblem):
    """The same with contacts pressed at the frozen eccentricities, or nearer to the middle where
    signs are independent: all of its forces are admissible under Eq. 30, if ``cone`` is the true
    one or inside it, and if the arms of its pressures are those of their centres."""

    formulation = staticmethod(pressed_resultants)

    def frozen_surfaces(self, pressure: Pressure) -> tuple[Frozen, ...]:
        """The frozen surface, and where contacts have to be pressed for it to be safe."""
        extent = half_extent(self.contacts)  # of which lengths in disjuncts are fractions
        disjuncts = states_of(self.moments).safe_disjuncts(self.contacts, pressure.centre / extent)
        # Tied signs fix the pressure centre itself: without a spread M1 and M2 are no unknowns.
        spread = extent * disjuncts.spread if self.moments.slopes is None else None
        return (*super().frozen_surfaces(pressure), Pressed(extent * disjuncts.centre, spread))

"""Mechanisms opened at their contacts until the flow rule allows them.

A solver's mechanism lacks a little of the opening that the flow rule asks for with its slips. A
field of block rates that opens every contact by more than the rule asks for makes up for that: the
mechanism and a share of the field together are allowed, and so prove an upper bound.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvxlimit.base.arrays import EPSILON, FloatArray
from cvxlimit.model.statics import DOF
from cvxlimit.proof.references import References
from cvxlimit.proof.strength import Strength
from cvxlimit.solvers.running import Flows


class OpenedMechanism(NamedTuple):
    """A mechanism after its contacts were opened until the flow rule allows it.

    Attributes
    ----------
    rates : (free blocks, 6)
        The opened mechanism; the original one where ``is_allowed`` is False.
    dissipation : float
        The power that contacts dissipate at most in these rates.
    is_allowed : bool
        True if the flow rule allows ``rates`` at every contact.
    missing, violation : float
        The opening that the original mechanism lacked: summed over contacts, and at the worst.
    """

    rates: FloatArray
    dissipation: float
    is_allowed: bool
    missing: float
    violation: float


def open_mechanism(
    strength: Strength,
    references: References,
    mechanism: FloatArray,
    own: tuple[FloatArray, FloatArray] | None = None,
    duals: Flows | None = None,
) -> OpenedMechanism:
    """Returns a mechanism (free blocks, 6) with its contacts opened until the flow rule allows it;
    the mechanism as it is where no field is known that opens every contact.

    ``own`` are relative rates (n, 6) that are added to those of the mechanism, as a user's own
    limits on forces do, and the sums (n, 6) of the sizes of their terms, for rounding. ``duals``
    are a solver's that belong to the mechanism.
    """
    statics = strength.assemblage.statics
    relative, rounding = statics.relative_rates(mechanism), _rounding(strength, mechanism)
    sizes = mechanism.ravel()
    if own is not None:
        relative, sizes = relative + own[0], np.append(sizes, own[1])
        rounding = rounding + EPSILON * (own[1] * strength.rate_sizes).sum(axis=1)
    shortfall = strength.flow.shortfall(relative, duals)
    missing = shortfall.missing + rounding

    # A field that opens every contact, and its share t that makes up for what is missing.
    field, share = None, 0.0
    lacks = missing > 0.0  # a contact without any state misses -inf and has inf to spare
    if not lacks.any():
        field = np.zeros((len(statics.dead) // DOF, DOF))
    for candidate in references.opening_fields() if field is None else ():
        spare = spare_opening(strength, candidate)
        if spare.min() > 0.0:
            field, share = candidate, float(np.max(missing[lacks] / spare[lacks], initial=0.0))
            break

    # The opened mechanism, and what it dissipates.
    is_allowed = field is not None and _is_resisted(shortfall.unresisted, sizes)
    rates, dissipation = mechanism, shortfall.dissipation
    if field is not None and is_allowed:
        rates = mechanism + share * field
        if share > 0.0 and not strength.is_cone:
            by_field = strength.flow.opened(statics.relative_rates(field))
            dissipation += share * by_field.dissipation
    total = float(np.maximum(missing, 0.0).sum() + np.abs(shortfall.unresisted).sum())
    return OpenedMechanism(rates, dissipation, is_allowed, total, max(float(missing.max()), 0.0))


def spare_opening(strength: Strength, rates: FloatArray) -> FloatArray:
    """Returns by how much block rates (free blocks, 6) open each contact (n,) beyond what the flow
    rule asks for, less rounding; -inf everywhere if some slip is resisted by no surface."""
    shortfall = strength.flow.opened(strength.assemblage.statics.relative_rates(rates))
    spare: FloatArray = -shortfall.missing - _rounding(strength, rates)
    return np.where(_is_resisted(shortfall.unresisted, rates), spare, -np.inf)


def _rounding(strength: Strength, rates: FloatArray) -> FloatArray:
    """Returns how large the rounding in the opening of each contact (n,) may be."""
    size = (strength.assemblage.statics.sizes.T @ np.abs(rates).ravel()).reshape(-1, DOF)
    return np.asarray(EPSILON * (size * strength.rate_sizes).sum(axis=1))


def _is_resisted(unresisted: FloatArray, rates: FloatArray) -> bool:
    """Returns True if yield surfaces resist all slip and twist of ``rates``, up to rounding."""
    return not np.abs(unresisted).max(initial=0.0) > 1e-15 * np.abs(rates).max()

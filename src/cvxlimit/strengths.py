"""Friction and strengths of contacts: those of the whole scene, and those of a pair of blocks."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.checks import not_negative, of_type, strength
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import Contacts

FloatArray = NDArray[np.float64]

BY_CONTACT = {
    "friction": not_negative,
    "cohesion": not_negative,
    "compressive_strength": strength,
    "tensile_strength": not_negative,
}
"""What contacts have from the scene, or of their own, and how it is checked."""

PER_AREA = ("cohesion", "compressive_strength", "tensile_strength")
"""Those that are forces per area."""


def own_values(what: str, given: Any, blocks: Collection[str]) -> Mapping[tuple[str, ...], float]:
    """Values by pair of block ids in alphabetical order, checked; None is no pair.

    Raises
    ------
    InputError
        If it is no mapping of two ids to a number, names a block that is not among ``blocks``, or
        gives a pair twice.

    Example
    -------
    >>> dict(own_values("friction", {("b2", "b1"): 0.5}, ["b1", "b2"]))
    {('b1', 'b2'): 0.5}
    """
    kind = f"contact_{what} must be a mapping of two ids to a number"
    cure = "write {('b1', 'b2'): 0.5}"
    checked: dict[tuple[str, ...], float] = {}
    for pair, value in of_type({} if given is None else given, Mapping, kind, cure).items():
        two = isinstance(pair, tuple) and len(pair) == 2
        if not (two and all(isinstance(key, str) for key in pair)):
            raise InputError(f"{kind}, got {pair!r}: {cure}")
        contact = f"contact {pair[0]!r}-{pair[1]!r}"
        for key in pair:
            if key not in blocks:
                raise InputError(f"{what} is given for {contact}, but there is no block {key!r}")
        ordered = tuple(sorted(pair))
        if ordered in checked:
            raise InputError(f"{what} of contact {ordered[0]!r}-{ordered[1]!r} is given twice")
        checked[ordered] = BY_CONTACT[what](value, f"{what} of {contact}")
    return MappingProxyType(checked)


def of_contacts(
    what: str, default: float, own: Mapping[tuple[str, ...], float], contacts: Contacts
) -> FloatArray:
    """The value (n,) of every contact: its pair's own, or the default.

    Raises
    ------
    InputError
        If a pair of blocks with a value of its own does not touch.
    """
    if not own:
        return np.full(len(contacts), default)
    ids = contacts.block_ids
    pairs = [tuple(sorted((ids[a], ids[b]))) for a, b in zip(contacts.a, contacts.b, strict=True)]
    unknown = set(own) - set(pairs)
    if unknown:
        a, b = sorted(unknown)[0]
        raise InputError(
            f"{what} is given for contact {a!r}-{b!r}, but these blocks do not touch: "
            "remove the entry or move the blocks"
        )
    return np.array([own.get(pair, default) for pair in pairs])

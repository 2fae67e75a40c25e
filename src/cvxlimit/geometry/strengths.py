"""Friction and strengths of contacts: which there are, and how a scene assigns them to contacts.

:class:`JointValues` is the only list of these properties. Scenes, contacts, copies in other units,
scene files, sweeps, pickles and keys of stored results take them from its fields.
"""

# ruff: noqa: RUF009  # _property is field() of dataclasses

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Generic, TypeVar

import numpy as np

from cvxlimit.base.checks import not_negative, of_type, strength
from cvxlimit.errors import InputError

V = TypeVar("V")
DEFAULT_FRICTION = 0.7
"""Coulomb coefficient of joints for which none is stated: tan 35 degrees, usual for dry stone."""

Pair = tuple[str, str]
ByPair = Mapping[Pair, float]


def _property(default: float, check: Callable[[Any, str], float], *, per_area: bool = False) -> Any:
    """Returns a dataclass field with its default, its check, and whether it is a force per area."""
    return field(default=default, metadata={"check": check, "per_area": per_area})


@dataclass(frozen=True, eq=False, kw_only=True)
class JointValues(Generic[V]):
    """Friction and strengths: each a number for a scene, and an array (n,) for n contacts.

    A property is added by a line here and one for its exceptions in :class:`SceneJoints`. Surfaces
    read it from the contacts; methods that state friction themselves (interaction, exact, fixed
    point) read ``friction`` alone, and have to take the new property into account or
    refuse it.

    Attributes
    ----------
    friction
        Coulomb coefficient (dimensionless).
    cohesion
        Shear resistance besides friction (force per area).
    compressive_strength
        Largest pressure that the stones bear (force per area).
    tensile_strength
        Largest tension that the mortar bears (force per area).
    """

    friction: V = _property(DEFAULT_FRICTION, not_negative)
    cohesion: V = _property(0.0, not_negative, per_area=True)
    compressive_strength: V = _property(float("inf"), strength, per_area=True)
    tensile_strength: V = _property(0.0, not_negative, per_area=True)


PROPERTIES = {each.name: each for each in fields(JointValues)}
"""The fields by name: each has its default and, as metadata, its ``check`` and whether it is a
force ``per_area``."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneJoints(JointValues[float]):
    """Joints of a scene: one value of each property for all contacts, and exceptions by pair.

    ``contact_...`` maps pairs of block ids, in alphabetical order, to values; it is read-only, and
    None means that there is no exception.
    """

    contact_friction: ByPair = field(default_factory=dict)
    contact_cohesion: ByPair = field(default_factory=dict)
    contact_compressive_strength: ByPair = field(default_factory=dict)
    contact_tensile_strength: ByPair = field(default_factory=dict)

    @property
    def joint_values(self) -> dict[str, Any]:
        """All properties and their exceptions, by field name."""
        names = [name for what in PROPERTIES for name in (what, f"contact_{what}")]
        return {name: getattr(self, name) for name in names}

    def _check_joints(self, blocks: Collection[str]) -> None:
        """Check all values, and put exceptions in order; ``blocks`` are the ids that exist."""
        for what, each in PROPERTIES.items():
            value = each.metadata["check"](getattr(self, what), f"{what} of the scene")
            own = own_values(what, getattr(self, f"contact_{what}"), blocks)
            object.__setattr__(self, what, value)
            object.__setattr__(self, f"contact_{what}", own)

    def _given_to(self, contacts: Any) -> Any:
        """Returns ``contacts`` with these properties.

        Raises
        ------
        InputError
            If an exception names two blocks without a contact.
        """
        values: dict[str, Any] = {}
        for what in PROPERTIES:
            values[what] = default = getattr(self, what)
            own: ByPair = getattr(self, f"contact_{what}")
            for a, b in sorted(set(own).difference(contacts.pairs)) if own else ():
                raise InputError(
                    f"{what} is given for contact {a!r}-{b!r}, but these blocks do not touch: "
                    "remove the entry or move the blocks"
                )
            if own:
                values[what] = np.array([own.get(pair, default) for pair in contacts.pairs])
        return contacts.with_values(**values)

    def _scaled_joints(self, pressure: float) -> dict[str, Any]:
        """Returns all values, those per area multiplied by ``pressure``: a change of units."""
        result = self.joint_values
        for what, each in PROPERTIES.items():
            if each.metadata["per_area"]:
                own = result[f"contact_{what}"]
                result[what] *= pressure
                result[f"contact_{what}"] = {pair: pressure * value for pair, value in own.items()}
        return result


def own_values(what: str, given: Any, blocks: Collection[str]) -> ByPair:
    """Returns checked values of property ``what`` by pair of block ids in alphabetical order;
    ``given`` is what the user wrote, None for no pair, and ``blocks`` are the ids that exist."""
    kind = f"contact_{what} must be a mapping of two ids to a number"
    cure = "write {('b1', 'b2'): 0.5}"
    checked: dict[Pair, float] = {}
    for pair, value in of_type({} if given is None else given, Mapping, kind, cure).items():
        two = isinstance(pair, tuple) and len(pair) == 2
        if not (two and all(isinstance(key, str) for key in pair)):
            raise InputError(f"{kind}, got {pair!r}: {cure}")
        contact = f"contact {pair[0]!r}-{pair[1]!r}"
        for key in pair:
            if key not in blocks:
                raise InputError(f"{what} is given for {contact}, but there is no block {key!r}")
        first, second = sorted(pair)
        if (first, second) in checked:
            raise InputError(f"{what} of contact {first!r}-{second!r} is given twice")
        checked[first, second] = PROPERTIES[what].metadata["check"](value, f"{what} of {contact}")
    return MappingProxyType(checked)

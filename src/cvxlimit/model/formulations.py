"""Which internal forces describe a contact: corner compressions, or the six resultants.

Contact forces x (n, 6) are a linear map of internal forces s (p,), x = R s, some of which are not
negative. A formulation is a function of contacts that names vectors of internal forces
(:class:`Part`) and says what each gives at its contact; together they are a :class:`ForceModel`,
which makes R, the conditions to be written on s, and s as unknowns of a problem.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from types import MappingProxyType
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.model.sinks import gathered
from cvxlimit.surfaces.base import (
    CONSTANT,
    Coefficient,
    Condition,
    LinearForm,
    Norm,
    YieldSurface,
    check_condition,
    conditions_of,
    is_some,
    product,
)
from cvxlimit.surfaces.cones import Cone, Conic, Sink

FORCES = ("V1", "V2", "N")


@dataclass(frozen=True, eq=False)
class Part:
    """A vector of k internal forces of one kind, and what each gives at its contact.

    Attributes
    ----------
    name : str
        For conditions of the formulation's own; V1 ... MT always mean the contact's resultants.
    components : mapping of component to number or (k,) array
        Contact force components per unit: ``{"N": 1, "M1": y, "M2": -x}`` for a compression at a
        point (x, y) of the contact. User's units. Empty for variables that appear in conditions
        only.
    contact : (k,) int array
    nonneg : bool
        True for compressions.
    is_force : bool
        True for a force that gives a moment by an arm of its own.
    """

    name: str
    components: Mapping[str, float | FloatArray]
    contact: IntArray
    nonneg: bool = False
    is_force: bool = False

    @property
    def is_moment(self) -> bool:
        """True for a part that gives moments only; a part that gives nothing counts as a force."""
        has_forces = not self.components.keys().isdisjoint(FORCES)
        return bool(self.components) and not has_forces and not self.is_force


@dataclass(frozen=True, eq=False)
class ForceModel:
    """The p internal forces s of all contacts, and the surfaces that hold by their choice.

    Attributes
    ----------
    contacts : Contacts
    parts : sequence of Part
        Contact forces are the sum of what they give; ``start`` says where each stands in s.
    conditions : sequence of Condition
        Strength that the formulation states itself, on its parts' names or on components; both
        sides forces in the user's units. ``cone`` is for their norms.
    implied : frozenset of str
        Names of surfaces whose conditions its forces satisfy by construction.
    count : int
        Number of contacts.
    nonneg, is_moment : (p,) array of bool, contact : (p,) int array
        Of every internal force.

    Raises
    ------
    ModelError
        For unknown components, twice the same name, or contacts that do not exist.
    """

    contacts: Contacts
    parts: Sequence[Part]
    conditions: Sequence[Condition] = ()
    implied: frozenset[str] = frozenset({"rocking"})
    cone: Cone = field(default_factory=Conic)
    count: int = field(init=False)
    start: Mapping[str, slice] = field(init=False)
    nonneg: NDArray[np.bool_] = field(init=False)
    is_moment: NDArray[np.bool_] = field(init=False)
    contact: IntArray = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.contacts)
        names = [part.name for part in self.parts]
        if len(set(names)) < len(names):
            raise ModelError(f"parts of a formulation need names of their own, got {names}")
        for part in self.parts:
            unknown = [c for c in part.components if c not in COLUMN]
            if unknown:
                raise ModelError(
                    f"part {part.name!r} gives {unknown[0]!r}, which is no force component: "
                    f"known are {', '.join(COMPONENTS)}"
                )
        for condition in self.conditions:
            check_condition(condition, "the formulation", count, names)
        sizes = [len(part.contact) for part in self.parts]
        ends = np.cumsum(sizes).tolist()
        self.__dict__.update(
            count=count,
            start=dict(zip(names, map(slice, [0, *ends], ends), strict=False)),
            contact=np.concatenate([part.contact for part in self.parts]),
            nonneg=np.repeat([part.nonneg for part in self.parts], sizes),
            is_moment=np.repeat([part.is_moment for part in self.parts], sizes),
        )

    @cached_property
    def resultant_map(self) -> sp.csr_array:
        """Contact forces (6 n, p) per unit of the internal ones."""
        entries = [
            (self.start[part.name], len(COMPONENTS) * part.contact + COLUMN[component], value)
            for part in self.parts
            for component, value in part.components.items()
        ]
        row = np.concatenate([at for _, at, _ in entries])
        column = np.concatenate([np.arange(where.start, where.stop) for where, _, _ in entries])
        each = np.concatenate([np.broadcast_to(value, len(at)) for _, at, value in entries])
        shape = len(COMPONENTS) * self.count, len(self.contact)
        return sp.csr_array((each.astype(float), (row, column)), shape=shape)

    def values(self, internal: FloatArray) -> dict[str, FloatArray]:
        """Internal forces (p,) by part, and the contacts' components (n,)."""
        forces = self.forces(internal)
        parts = {name: internal[where] for name, where in self.start.items()}
        return parts | {c: forces[:, column] for c, column in COLUMN.items()}

    def forces(self, internal: FloatArray) -> FloatArray:
        """Contact forces (n, 6) of internal ones (p,)."""
        return np.asarray(self.resultant_map @ internal).reshape(-1, len(COMPONENTS))

    def all_conditions(self, surfaces: Sequence[YieldSurface]) -> list[tuple[str, Condition, Cone]]:
        """Conditions to be written, by name: of surfaces that do not hold already, and its own."""
        names = list(self.start)
        needed = [surface for surface in surfaces if surface.name not in self.implied]
        stated = conditions_of(needed, self.contacts, names)
        written = [(surface.name, condition, surface.cone) for surface, condition in stated]
        written += [("formulation", condition, self.cone) for condition in self.conditions]
        faces = self.contacts.faces
        if len(faces) < self.count:
            written = [(name, c.on_faces(faces), cone) for name, c, cone in written]
            written = [each for each in written if len(each[1].rows(0))]
        for _, condition, _ in written:
            rows = self.count if condition.contact is None else len(condition.contact)
            for name in chain.from_iterable(condition.forms()):
                where = self.start.get(name)
                size = rows if where is None or name in COLUMN else where.stop - where.start
                if size != rows:
                    raise ModelError(
                        f"a condition on {name!r} has {rows} rows where {name!r} has {size} "
                        "entries: give the condition the contact of each entry, or, if a force "
                        f"component is meant, write one of {', '.join(COMPONENTS)}"
                    )
        return written

    def unknowns(
        self, into: Sink, force: float = 1.0, length: float = 1.0,
        components: Mapping[str, LinearForm] = MappingProxyType({}),
    ) -> tuple[dict[str, Any], list[Any]]:  # fmt: skip
        """The forces as new unknowns of a sink.

        ``components`` may give a part as a linear form of parts before it, of force components, or
        of unknowns that no part has, which are made here; a part without a form is an unknown.

        Returns
        -------
        forces : dict
            Forms of components and parts by name, over the unit ``force``.
        internal : list
            Forms of the parts in order, moments over the unit ``length`` besides.
        """
        forces, internal = _Forces(self), []
        forces[CONSTANT] = 1.0 / force
        for part in self.parts:
            unit, size = length if part.is_moment else 1.0, len(part.contact)
            form = components.get(part.name, {})
            for name in [name for name in form if name not in {**forces, **forces.parts}]:
                forces[name] = into.new(size, name)
            if form:
                value = express(form, forces, None if size == self.count else part.contact)
                internal.append(value / unit)
            else:
                internal.append(into.new(size, part.name, part.nonneg))
                value = internal[-1] if unit == 1.0 else unit * internal[-1]
            forces.parts[part.name] = value
            if part.name not in (*COMPONENTS, CONSTANT):  # these always mean the contact's
                forces[part.name] = value
        return forces, internal


class _Forces(dict[str, Any]):
    """Parts as forms of a sink, and components, which are put together when they are asked for."""

    def __init__(self, model: ForceModel) -> None:
        self._model = model
        self.parts: dict[str, Any] = {}

    def __missing__(self, component: str) -> Any:
        parts, n = self._model.parts, self._model.count
        giving = [part for part in parts if component in part.components]
        terms = [
            gathered(self.parts[part.name], part.contact, n, part.components.get(component, 0.0))
            for part in giving or parts[:1]  # nothing of one, where none gives any
        ]
        self[component] = sum(terms[1:], start=terms[0])
        return self[component]


def express(form: LinearForm, forces: Mapping[str, Any], contact: IntArray | None = None) -> Any:
    """Returns a linear form of force components, which are arrays or forms of a sink; ``contact``
    as in :class:`~cvxlimit.surfaces.base.Condition`."""

    def of(name: str) -> Any:
        value = forces[name]  # unknowns that are no components have a row each already
        return value if contact is None or name not in COLUMN else value[contact]

    terms = [times(k, of(component)) for component, k in form.items() if component != CONSTANT]
    terms = terms or [times(0.0, of("N"))]  # a form without components is 0
    # The constant comes last: it may be an expression of CVXPY, which adds no other kind.
    if CONSTANT in form:
        terms.append(product(form[CONSTANT], forces[CONSTANT]))
    return sum(terms[1:], start=terms[0])


def times(coefficient: Coefficient, component: Any) -> Any:
    """Returns a form of a sink times a coefficient, entry by entry."""
    if isinstance(coefficient, (int, float)):
        return component if coefficient == 1 else coefficient * component
    if not isinstance(component, cp.Expression):
        return component.times(coefficient)
    # A name for the numbers, so that a printed problem is short.
    if not isinstance(coefficient, cp.Expression):
        coefficient = cp.Constant(coefficient, name=f"[{np.size(coefficient)} numbers]")
    return cp.multiply(coefficient, component)


Formulation = Callable[[Contacts], ForceModel]

Numbers = Mapping[str, float | FloatArray]


def corner_compressions(contacts: Contacts) -> ForceModel:
    """N, M1, M2 from one compression n >= 0 at every corner of the contact's polygon.

    Rocking (Eq. 9) holds by construction for any convex polygon. The fastest form measured.
    """
    parts = [Part(c, {c: 1}, contacts.faces) for c in ("V1", "V2", "MT")]
    n = compressions_at(contacts, contacts.corner_contact, contacts.corner_xy)
    return ForceModel(contacts, [n, *parts])


def compressions_at(contacts: Contacts, contact: IntArray, at: FloatArray, name: str = "n") -> Part:
    """A compression at each of some points (k, 2) of contacts (k,); of ties a tension."""
    normal = contacts.sense[contact] if contacts.is_point.any() else 1
    return Part(name, {"N": normal, "M1": at[:, 1], "M2": -at[:, 0]}, contact, nonneg=True)


def friction_at(contact: IntArray, at: FloatArray, resistance: LinearForm) -> tuple[Any, Condition]:
    """Forces v1, v2 at points (k, 2) of contacts (k,), and the condition that bounds them."""
    x, y = at.T
    parts = [Part("v1", {"V1": 1, "MT": -y}, contact), Part("v2", {"V2": 1, "MT": x}, contact)]
    return parts, Condition([Norm({"v1": 1}, {"v2": 1})], resistance, contact)


def resultants(contacts: Contacts) -> ForceModel:
    """The six components of Eq. 1 as variables; rocking is one row per contact edge."""
    parts = [Part(c, {c: 1}, contacts.faces) for c in COMPONENTS if c != "N"]
    parts.insert(2, Part("N", {"N": 1}, np.arange(len(contacts))))
    return ForceModel(contacts, parts, implied=frozenset())


def vertex_forces(contacts: Contacts) -> ForceModel:
    """One force at every corner, each within its own friction cone (as RBE and CRA do).

    The hull of all pressure fields with friction at every point, and so the least restrictive model
    of interaction with bending: pressed at its centre a square resists 1.85 times the torsion of a
    uniform pressure, pressed at a corner none. Cohesion is shared equally by the corners. It states
    its own strength: give ``[Rocking()]`` as surface.

    >>> from cvxlimit import builtin_scene, solve
    >>> from cvxlimit.surfaces import Rocking
    >>> scene = builtin_scene("tuff-wall")
    >>> round(solve(scene, [Rocking()], formulation=vertex_forces).load_factor, 4)
    0.3642
    """
    n = compressions_at(contacts, contacts.corner_contact, contacts.corner_xy)
    at = np.flatnonzero(~contacts.is_point[n.contact])
    j = n.contact[at]
    resistance: dict[str, Coefficient] = {"n": contacts.friction[j]}
    if is_some(contacts.cohesion):
        corners = np.diff(contacts.corner_start)
        resistance[CONSTANT] = product(contacts.cohesion, contacts.area / corners)[j]
    slips, coulomb = friction_at(j, contacts.corner_xy[at], resistance)
    if len(at) == len(n.contact):
        return ForceModel(contacts, [n, *slips], [coulomb])
    # Contacts that are points have no friction: their compressions are a part of their own.
    others = np.setdiff1d(np.arange(len(n.contact)), at)
    own = compressions_at(contacts, j, contacts.corner_xy[at])
    rest = compressions_at(contacts, n.contact[others], contacts.corner_xy[others], "reaction")
    return ForceModel(contacts, [own, rest, *slips], [coulomb])


def rotated(root: str, first: Numbers, second: Numbers, contact: IntArray) -> Condition:
    """Returns the condition root^2 <= first x second, a rotated cone, written as
    sqrt((2 root)^2 + (first - second)^2) <= first + second."""
    names = {**first, **second}
    total = {name: first.get(name, 0.0) + second.get(name, 0.0) for name in names}
    difference = {name: first.get(name, 0.0) - second.get(name, 0.0) for name in names}
    return Condition([Norm({root: 2.0}, difference)], total, contact)

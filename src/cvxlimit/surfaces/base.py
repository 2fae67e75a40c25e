"""What a yield surface is: conditions "sum of norms <= resistance", stated once per surface.

A surface states physics only, in the scene's own units. From its conditions follow the CVXPY
constraints of the static problem, the flow rule of the kinematic problem
(:mod:`cvxlimit.proof.flow`), and the yield excess in NumPy.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, ClassVar, TypeAlias

import cvxpy as cp
import numpy as np

from cvxlimit.base.arrays import BoolArray, FloatArray, IntArray
from cvxlimit.base.checks import meant
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts, least_carried
from cvxlimit.surfaces.cones import Cone, Conic

Coefficient: TypeAlias = "float | FloatArray | cp.Expression"
LinearForm = Mapping[str, Coefficient]
"""Force component -> coefficient: one number, one per row, or an expression in Parameters. The key
``"1"`` is a constant: a force, in the user's unit."""

CONSTANT = "1"
"""Key of a linear form's constant."""


class Norm:
    """Weighted size of a vector of linear forms: ``Norm({"V1": 1}, {"V2": 1}, weight=2.0)``.

    A weight in Parameters keeps them out of the cone's rows: only one row then depends on them. It
    is not negative, for the condition would not be convex.
    """

    def __init__(self, *rows: LinearForm, weight: Coefficient = 1.0) -> None:
        self.rows = rows
        self.weight = weight
        self.is_plain = isinstance(weight, (int, float)) and weight == 1

    @property
    def weighted_rows(self) -> list[LinearForm]:
        """The rows times the weight: the same norm without one."""
        if self.is_plain:
            return list(self.rows)
        return [{c: product(self.weight, k) for c, k in row.items()} for row in self.rows]


@dataclass(frozen=True, eq=False)
class Condition:
    """Sum of norms <= resistance, at every contact or in rows of its own.

    Both sides are forces; a resistance may hold a constant, such as the cohesion of mortar. What
    has a constant only on the side of the resistance, none of them negative, holds without forces.

    Attributes
    ----------
    norms : sequence of Norm
        May be empty: then the resistance itself must not be negative.
    resistance : LinearForm
        For Coulomb friction and cohesion :func:`slip_resistance`.
    contact : (k,) int array or None
        Contact of each row (a polygon's edges or corners, say), from which components are taken;
        None means one row per contact. Coefficients have that length.
    """

    norms: Sequence[Norm]
    resistance: LinearForm
    contact: IntArray | None = None

    def forms(self) -> Iterator[LinearForm]:
        """The resistance and all rows of norms."""
        yield self.resistance
        for norm in self.norms:
            yield from norm.rows

    def rows(self, contacts: int) -> IntArray:
        """Contact of each row, among so many contacts."""
        return np.arange(contacts) if self.contact is None else self.contact

    def unresisted(self, contacts: int) -> BoolArray:
        """In which of its rows nothing resists the forces that norms limit, at present values."""
        sizes = (np.abs(number(k)) for k in self.resistance.values())
        return (sum(sizes, np.zeros(len(self.rows(contacts)))) == 0.0) & bool(self.norms)

    def at_present(self) -> tuple[LinearForm, Sequence[LinearForm]]:
        """The resistance, and all rows of norms times their weights, in numbers at the present
        values of Parameters."""
        rows = chain.from_iterable(norm.weighted_rows for norm in self.norms)
        forms = (self.resistance, *rows)
        first, *others = ({name: number(k) for name, k in form.items()} for form in forms)
        return first, others

    def on_faces(self, faces: IntArray) -> Condition:
        """The condition without its rows at points, which have none but bounds."""
        if self.contact is not None:
            return self

        at = partial(_on_faces, faces=faces)
        norms = [Norm(*map(at, n.rows), weight=at({"": n.weight})[""]) for n in self.norms]
        return Condition(norms, at(self.resistance), faces)

    def recession(self) -> Condition:
        """The condition without its constants: the directions in which forces may grow."""
        norms = [Norm(*(_plain(row) for row in n.rows), weight=n.weight) for n in self.norms]
        return replace(self, norms=norms, resistance=_plain(self.resistance))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A surface in unknowns of its own, one of each per contact, which some solvers find easier.

    ``components`` maps force components to linear forms of the unknowns; ``conditions`` are the
    surface's conditions in the unknowns.
    """

    components: Mapping[str, LinearForm]
    conditions: Sequence[Condition]

    def on_faces(self, faces: IntArray) -> Unknowns:
        """These with one of each per face: points have none but bounds."""
        components = {name: _on_faces(form, faces) for name, form in self.components.items()}
        return Unknowns(components, [condition.on_faces(faces) for condition in self.conditions])


class YieldSurface(ABC):
    """A convex set of admissible forces for every contact.

    To add a surface, subclass and state its conditions; nothing else needs to change:

    >>> class Ellipse(YieldSurface):
    ...     '''sqrt(V^2 + (MT / c_T)^2) <= mu N.'''
    ...     name = "ellipse"
    ...     def conditions(self, contacts):
    ...         size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
    ...         return [Condition([size], slip_resistance(contacts))]
    >>> Ellipse().name
    'ellipse'

    Attributes
    ----------
    name : str
        Field's term for the surface.
    implies : frozenset of str
        Names of surfaces that hold wherever this one does; their rows are not written.
    torsion_shear : str
        How results call its limit of torsion and shear together, ``"linear"`` for example; empty,
        as a rule, for a surface that states none, or one under a name of its own.
    cone : Cone
        How norms of two components are bounded: :class:`Conic` or :class:`Facets`.
    """

    name: ClassVar[str]
    implies: ClassVar[frozenset[str]] = frozenset()
    torsion_shear: ClassVar[str] = ""
    cone: Cone = Conic()

    def __init__(self, cone: Cone | None = None) -> None:
        if cone is not None:
            self.cone = cone

    @abstractmethod
    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        """The surface's conditions, both sides forces; ``contacts`` in the scene's units."""

    def unknowns(self, contacts: Contacts) -> Unknowns | None:
        """Conditions in a form with unknowns of their own, for solvers; None, as a rule, for the
        conditions above."""
        return None

    def excess(self, forces: FloatArray, contacts: Contacts) -> list[FloatArray]:
        """Yield function y of forces (n, 6), one array per condition; <= 0 is admissible."""
        return excesses([(c, self.cone) for c in stated(self, contacts)], columns(forces))


class Recession(YieldSurface):
    """The directions in which another surface's forces may grow without end: its constants dropped.

    A live load is harmless only if forces in these directions carry it.
    """

    def __init__(self, surface: YieldSurface) -> None:
        super().__init__(surface.cone)
        self.surface = surface
        self.name = surface.name  # type: ignore[misc]  # stands for it wherever names are asked
        self.implies = surface.implies  # type: ignore[misc]

    def conditions(self, contacts: Contacts) -> Sequence[Condition]:
        return [condition.recession() for condition in self.surface.conditions(contacts)]


def has_constants(conditions: Iterable[Condition]) -> bool:
    """Returns True if one of the conditions has constants other than zero."""
    forms = chain.from_iterable(condition.forms() for condition in conditions)
    return any(np.any(number(form.get(CONSTANT, 0.0))) for form in forms)


def conditions_of(
    surfaces: Iterable[YieldSurface], contacts: Contacts, parts: Sequence[str] = ()
) -> list[tuple[YieldSurface, Condition]]:
    """Returns the conditions of several surfaces, after checks for what is easily mistyped;
    ``parts`` are components that they may name besides the six."""
    count, result = len(contacts), list[tuple[YieldSurface, Condition]]()
    for surface in surfaces:
        every = surface.conditions(contacts)
        result += [(surface, c) for c in (every if isinstance(every, Iterable) else [every])]
    for surface, condition in result:
        check_condition(condition, f"surface {surface.name!r}", count, parts)
    return result


def stated(surface: YieldSurface, contacts: Contacts) -> list[Condition]:
    """Returns one surface's conditions, checked likewise."""
    return [condition for _, condition in conditions_of([surface], contacts)]


def check_condition(
    condition: Condition, owner: str, contacts: int, parts: Sequence[str] = ()
) -> None:
    """Raises ModelError, in the name of the ``owner``, for a condition that is no Condition, whose
    forms name unknown components, or whose coefficients have the wrong shape, size or sign."""
    if not isinstance(condition, Condition):
        raise ModelError(f"{owner} must state Condition objects, got {condition!r}")
    of_rows = condition.contact
    if of_rows is not None and np.ndim(of_rows) != 1:
        raise ModelError(
            f"contact of a condition in {owner} must be the contact of each row, got "
            f"{of_rows!r}: a constant belongs into the resistance, as {{'1': ...}}"
        )
    known = np.arange(contacts)
    numbers = known if of_rows is None else np.asarray(of_rows)
    if numbers.dtype.kind not in "iu" or not np.isin(numbers, known).all():
        raise ModelError(
            f"contact of a condition in {owner} must be numbers of contacts, from 0 to "
            f"{contacts - 1}, got {of_rows!r}"
        )
    if not all(norm.rows for norm in condition.norms):
        raise ModelError(f"a Norm in {owner} has no rows: leave it out, or write Norm({{'V1': 1}})")
    rows, names = len(numbers), [*COMPONENTS, CONSTANT, *parts]
    for form in condition.forms():
        if not isinstance(form, Mapping):
            raise ModelError(
                f"{owner} must state forces times numbers, as {{'N': 0.5}}, got {form!r}"
            )
        for component, coefficient in form.items():
            if component not in names:
                hint = meant(component, names, f"known are {', '.join(names)}", likeness=0.5)
                raise ModelError(f"{owner} has no force component {component!r}: {hint}")
            _check_coefficient(coefficient, f"coefficient of {component} in {owner}", rows)
    for norm in condition.norms:
        if norm.is_plain:
            continue
        _check_coefficient(norm.weight, f"weight of a norm in {owner}", rows)
        # Parameters may not have values yet.
        weight = norm.weight
        weights = weight.value if isinstance(weight, cp.Expression) else weight
        if weights is not None and np.min(weights, initial=0.0) < 0.0:
            raise ModelError(
                f"weight of a norm in {owner} must not be negative, got {np.min(weights):g}: "
                "the condition would not be convex; give its size"
            )


def _check_coefficient(coefficient: Coefficient, what: str, rows: int) -> None:
    """Raises ModelError unless a coefficient is a finite number, or one for each of the rows."""
    if isinstance(coefficient, cp.Expression):
        if coefficient.variables():
            raise ModelError(
                f"{what} must not hold a variable, got {coefficient}: a force of one's own goes "
                "into a limit, LimitProblem.add, and a number into a Parameter"
            )
        return
    try:
        values = np.asarray(coefficient).astype(float, casting="same_kind")
    except (TypeError, ValueError) as error:
        raise ModelError(f"{what} must be a number, got {coefficient!r}") from error
    if values.shape not in ((), (rows,)):
        raise ModelError(
            f"{what} must be one number or {rows} of them, got an array of shape {values.shape}"
        )
    if not np.isfinite(values).all():
        raise ModelError(f"{what} must be finite, got {values[~np.isfinite(values)][:1] or values}")


def columns(forces: FloatArray) -> dict[str, FloatArray]:
    """Returns the columns of forces (n, 6) by name: V1, V2, N, M1, M2, MT."""
    return dict(zip(COLUMN, forces.T, strict=True))


def excesses(
    conditions: Iterable[tuple[Condition, Cone]], values: Mapping[str, FloatArray]
) -> list[FloatArray]:
    """Returns :func:`condition_excess` of every condition, with the cone of its norms."""
    return [condition_excess(condition, cone, values) for condition, cone in conditions]


def condition_excess(
    condition: Condition, cone: Cone, values: Mapping[str, FloatArray]
) -> FloatArray:
    """Returns the yield function of a condition, norms less resistance, one number per row, for
    force components (n,) by name. It is at most 0 where forces are admissible."""
    y = -evaluate(condition.resistance, values, condition.contact)
    for norm in condition.norms:
        rows = [evaluate(form, values, condition.contact) for form in norm.rows]
        y = y + number(norm.weight) * cone.gauge(rows)
    return y


def evaluate(
    form: LinearForm, values: Mapping[str, FloatArray], contact: IntArray | None = None
) -> FloatArray:
    """Returns the values of a linear form, one per row; ``contact`` is the contact of each row, as
    in :class:`Condition`."""
    result = np.zeros(len(values["N"]) if contact is None else len(contact))
    for component, coefficient in form.items():
        of = np.ones(1) if component == CONSTANT else values[component]
        if contact is not None and component in COLUMN:  # others have a row each already
            of = of[contact]
        result = result + number(coefficient) * of
    return result


def utilisation(surface: YieldSurface, forces: FloatArray, contacts: Contacts) -> FloatArray:
    """Share (n,) of each contact's strength that forces (n, 6) use; 1 on the surface, 0 unused.

    The resistance of a condition comes from compression and constants; its norms and all signed
    terms use it. For sliding that is abs(V) / (mu N), for rocking the distance of the pressure
    centre from the contact's centre over that of the edge beyond it. The largest of a surface's
    conditions counts. NaN where a contact carries nothing.

    Example
    -------
    Half the sliding strength, and the pressure centre a quarter of the side off the centre:

    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.surfaces import Rocking, Sliding
    >>> contacts = builtin_scene("single-block").contacts
    >>> mu, l1 = contacts.friction[0], contacts.sides[0, 0]
    >>> forces = np.array([[0.5 * mu, 0.0, 1.0, 0.0, -0.25 * l1, 0.0]])
    >>> [utilisation(s, forces, contacts).round(12).tolist() for s in (Sliding(), Rocking())]
    [[0.5], [0.5]]
    """
    values = columns(forces)
    least = least_carried(forces)
    result = np.full(len(contacts), np.nan)
    for condition in stated(surface, contacts):
        at = condition.rows(len(contacts))
        np.fmax.at(result, at, _used(condition, surface.cone, values, least))
    return np.maximum(result, 0.0) + 0.0


def _used(
    condition: Condition, cone: Cone, values: Mapping[str, FloatArray], least: float
) -> FloatArray:
    """Returns the share of a condition's strength that forces use, one per row; NaN where the
    strength is not above ``least``."""
    strength = {k: c for k, c in condition.resistance.items() if k in ("N", CONSTANT)}
    signed = {k: c for k, c in condition.resistance.items() if k not in strength}
    used = condition_excess(replace(condition, resistance=signed), cone, values)
    available = evaluate(strength, values, condition.contact)
    carries = available > least
    return np.where(carries, used, np.nan) / np.where(carries, available, 1.0)


def number(coefficient: Coefficient) -> float | FloatArray:
    """Returns a coefficient in numbers, at the present values of its Parameters."""
    if isinstance(coefficient, cp.Expression):
        return np.asarray(coefficient.value, dtype=float)
    return coefficient


def is_some(coefficient: Coefficient) -> bool:
    """Returns False for a coefficient that is zero everywhere, and True for expressions in
    Parameters, whose values may change."""
    return isinstance(coefficient, cp.Expression) or bool(np.any(coefficient))


def product(first: Coefficient, second: Coefficient) -> Any:
    """Returns the product of two coefficients entry by entry; between CVXPY's vectors ``*`` would
    be the dot product."""
    if isinstance(first, cp.Expression) or isinstance(second, cp.Expression):
        return cp.multiply(first, second)
    return first * second


def slip_resistance(contacts: Contacts) -> LinearForm:
    """Returns mu N (Eq. 10), plus c A where the scene has cohesion: the largest force that slip
    works against.

    >>> from cvxlimit import builtin_scene
    >>> scene = builtin_scene("tuff-wall")
    >>> [[*slip_resistance(s.contacts)] for s in (scene, scene.with_cohesion(0.5))]
    [['N'], ['N', '1']]
    """
    friction: dict[str, Coefficient] = {"N": contacts.friction}
    if is_some(contacts.cohesion):
        friction[CONSTANT] = product(contacts.cohesion, contacts.area)
    return friction


def _on_faces(form: LinearForm, faces: IntArray) -> LinearForm:
    def of(coefficient: Any) -> Any:
        return coefficient if np.ndim(coefficient) == 0 else coefficient[faces]

    return {name: of(coefficient) for name, coefficient in form.items()}


def _plain(form: LinearForm) -> LinearForm:
    """Returns a form without its constant."""
    return {component: k for component, k in form.items() if component != CONSTANT}

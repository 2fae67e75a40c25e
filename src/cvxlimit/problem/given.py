"""What a limit problem is given in place of a scene's own numbers: strengths and loads that may be
CVXPY Parameters.

Numbers make another scene, whose mechanics are then the problem's; expressions of Parameters stay
expressions, in what the problem states (:class:`~cvxlimit.model.program.Given`). At the Parameters'
present values (:meth:`Values.at_present`) they are numbers, and make another scene as well: it is
that scene whose bracket a solve computes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from cvxpy.atoms.affine.promote import promote

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS, Contacts
from cvxlimit.geometry.strengths import PROPERTIES
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.model.program import Given
from cvxlimit.model.sinks import check_values
from cvxlimit.model.statics import DOF
from cvxlimit.scene import Scene
from cvxlimit.scene.loads import Load
from cvxlimit.scene.reactions import places
from cvxlimit.surfaces.base import number, product


@dataclass(frozen=True, eq=False)
class Values:
    """A scene whose strengths and loads may be expressions of Parameters.

    Attributes
    ----------
    assemblage : Assemblage
        The scene's mechanics, with those numbers that were given.
    given : Given
        What the problem states: expressions where Parameters were given.
    joints : mapping of property to expression (n,), weights : expression (free blocks,) or None
    loads : mapping of "dead" or "live" to expression (6 free blocks,)
        Those that were given as Parameters.
    """

    assemblage: Assemblage
    given: Given
    joints: Mapping[str, Any]
    weights: Any = None
    loads: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_symbolic(self) -> bool:
        """True if anything was given as a Parameter."""
        loads = (self.given.dead, self.given.live)
        return bool(self.joints) or any(isinstance(load, cp.Expression) for load in loads)

    @classmethod
    def of(cls, scene: Scene | Assemblage, values: Mapping[str, Any]) -> Values:
        """``values`` by name, of joints, loads, ``"weights"`` and bounds of reactions; None is the
        scene's."""
        own = {name: value for name, value in values.items() if value is not None}
        if not own and isinstance(scene, Assemblage):
            statics = scene.statics
            return cls(scene, Given(statics.contacts, statics.dead, statics.live), {})
        plain = scene.scene if isinstance(scene, Assemblage) else scene
        n, free = len(plain.contacts), len(plain.free)
        kinds = [*PROPERTIES], ["dead", "live"], ["most", "least"]
        strengths, loads, bounds = ({k: own.pop(k) for k in kind if k in own} for kind in kinds)
        weights, symbolic_loads = own.pop("weights", None), dict(loads)
        if own:
            raise TypeError(f"a limit problem has no {next(iter(own))}")
        joints = {
            name: _of_joints(plain, name, _shaped(name, value, n, "contacts"))
            for name, value in strengths.items()
        }
        joints |= _bounds(plain, bounds)
        numbers = {k: v for k, v in joints.items() if not isinstance(v, cp.Expression)}
        if numbers:
            plain = _jointed(plain, numbers)
        for name, value in loads.items():
            if isinstance(value, Load):
                plain = _loaded(plain, name, symbolic_loads.pop(name))
        weight = None if weights is None else _shaped("weights", weights, free, "free blocks")
        if weight is not None and not isinstance(weight, cp.Expression):
            plain, weight = _weighing(plain, weight), None
        symbols = {k: v for k, v in joints.items() if isinstance(v, cp.Expression)}
        is_same = plain is (scene.scene if isinstance(scene, Assemblage) else scene)
        whole = Assemblage.of(scene if is_same else plain)
        dead, live = whole.statics.dead, whole.statics.live
        if symbolic_loads or weight is not None:
            dead, live = _loads(plain, symbolic_loads, weight)
        symbolic = {"dead": dead, "live": live}
        symbolic = {name: symbolic[name] for name in symbolic_loads}
        given = _with_tension(whole, Given(plain.contacts, dead, live), symbols)
        return cls(whole, given, symbols, weight, symbolic)

    def at_present(self) -> Assemblage:
        """Returns the mechanics with the Parameters' present values in the scene's place."""
        if not self.is_symbolic:
            return self.assemblage
        check_values(self.parameters())
        scene = self.assemblage.scene
        values = {
            name: value if name in ("most", "least") else _of_joints(scene, name, value)
            for name, value in ((k, np.array(number(each))) for k, each in self.joints.items())
        }
        strength = values.get("compressive_strength", np.zeros(len(scene.contacts)))
        if np.isinf(strength[scene.contacts.faces]).any():
            raise ModelError(
                "compressive_strength as a Parameter must be finite, got inf: leave it out where "
                "joints do not crush, or give a large number"
            )
        if self.weights is not None:
            scene = _weighing(scene, np.array(number(self.weights)))
        ids = [scene.blocks[i].id for i in scene.free]
        for name, load in self.loads.items():
            forces = np.asarray(number(load)).reshape(-1, DOF)
            given = dict(zip(ids, map(tuple, forces), strict=True))
            scene = _loaded(scene, name, Load(forces=given))
        if values:
            scene = _jointed(scene, values)
        return self.assemblage.like(scene)

    def parameters(self) -> list[cp.Parameter]:
        """All that were given."""
        every = [*self.joints.values(), self.given.dead, self.given.live]
        parameters = [p for e in every if isinstance(e, cp.Expression) for p in e.parameters()]
        return list(dict.fromkeys(parameters))


def _shaped(what: str, value: Any, count: int, of: str) -> Any:
    """One for each: numbers, or an expression."""
    if isinstance(value, (list, tuple)) and any(isinstance(v, cp.Expression) for v in value):
        value = cp.hstack(list(value))
    is_symbolic = isinstance(value, cp.Expression)
    _refuse_variables(what, value)
    shape = value.shape if is_symbolic else np.shape(value)
    if shape not in ((), (count,)):
        raise ModelError(f"{what} must be one number or one for each of {count} {of}, got {shape}")
    if is_symbolic:
        return promote(value, (count,)) if shape == () else value
    return np.broadcast_to(np.asarray(value, dtype=float), (count,))


def _refuse_variables(what: str, value: Any) -> None:
    """Refuses expressions of Variables: friction times forces, both unknown, is not convex."""
    if isinstance(value, cp.Expression) and value.variables():
        cure = "give a Parameter, and solve at its values"
        if what == "friction":
            cure += "; docs/problem.md finds the least friction that carries a load so"
        name = value.variables()[0].name()
        raise ModelError(f"{what} must be known, got Variable {name!r}: {cure}")


def _of_joints(scene: Scene, what: str, values: Any) -> Any:
    """Strengths of joints are none of ties and reactions, which bear nothing but their force."""
    is_point = scene.contacts.is_point
    if not is_point.any():
        return values
    if isinstance(values, cp.Expression):  # none is infinite, and points do not crush
        return cp.multiply(values, ~is_point)
    return np.where(is_point, getattr(scene.contacts, what), values)


def _jointed(scene: Scene, values: Mapping[str, FloatArray]) -> Scene:
    """The scene whose contacts have these strengths, checked as a scene's own."""
    for what in PROPERTIES.keys() & values.keys():
        each = values[what]
        worst = int(np.argmin(np.where(np.isnan(each), -np.inf, each)))
        for j in {worst, int(np.argmax(each))}:
            name = f"{what} of contact {scene.contacts.names[j]!r}"
            PROPERTIES[what].metadata["check"](float(each[j]), name)
    contacts = scene.contacts.with_values(**values)
    wrong = contacts.is_point & ~((contacts.least >= 0.0) & (contacts.most >= contacts.least))
    if wrong.any():
        j = int(np.argmax(wrong))
        raise ModelError(
            f"bounds of {contacts.names[j]!r} must be 0 or more in the sense that the scene gives "
            f"them, least below most, got {contacts.least[j]:g} and {contacts.most[j]:g}"
        )
    return scene._with_contacts(contacts)


def _bounds(scene: Scene, given: Mapping[str, Any]) -> dict[str, Any]:
    """Bounds (n,) of all contacts where those of reactions were given: what pushes and what pulls
    are points of their own, each bounded from 0."""
    reactions, contacts = scene.reactions, scene.contacts
    if not given:
        return {}
    if not reactions:
        raise ModelError(f"{next(iter(given))} is of reactions, of which the scene has none")
    which, sense = np.array(places(reactions)).T
    which, first = which.astype(int), len(contacts) - len(which)
    result = dict[str, Any]()
    for name, value in given.items():
        each = _shaped(name, value, len(reactions), "reactions")
        # most bounds what pushes from above, and from below what only pulls; least does the reverse
        far = 1.0 if name == "most" else -1.0
        ends = far * np.array([getattr(reaction, name) for reaction in reactions])[which]
        for what, is_so in (("most", sense == far), ("least", (sense == -far) & (ends <= 0.0))):
            at = np.flatnonzero(is_so)
            placed = sp.csr_array(
                (sense[at], (first + at, which[at])), (len(contacts), len(reactions))
            )
            others = np.ones(len(contacts))
            others[first + at] = 0.0
            base = result.get(what, getattr(contacts, what))
            if isinstance(base, cp.Expression):
                base = cp.multiply(others, base)
            else:
                base = np.where(others, base, 0.0)
            if isinstance(each, cp.Expression):
                base = _finite(contacts, base)
            result[what] = base + placed @ each
    return result


def _finite(contacts: Contacts, bound: Any) -> Any:
    """Bounds (n,) as a part of an expression: joints have none."""
    if isinstance(bound, cp.Expression):
        return bound
    open_ones = np.flatnonzero(contacts.is_point & np.isinf(bound))
    if len(open_ones):
        raise ModelError(
            f"most of {contacts.names[open_ones[0]]!r} is infinite, which no expression is: give "
            "most as well, a large number"
        )
    return np.where(contacts.is_point, bound, 0.0)


def _weighing(scene: Scene, weights: FloatArray) -> Scene:
    """The scene whose free blocks have these weights."""
    blocks = list(scene.blocks)
    for i, weight in zip(scene.free.tolist(), weights.tolist(), strict=True):
        blocks[i] = replace(blocks[i], density=weight / blocks[i].volume)
    return scene._copy(blocks=tuple(blocks))


def _loaded(scene: Scene, name: str, load: Load) -> Scene:
    return scene.with_dead(load) if name == "dead" else scene.with_live(load)


def _loads(scene: Scene, given: Mapping[str, Any], weights: Any) -> tuple[Any, Any]:
    """Dead and live load (6 free blocks,) where one of them, or weights, are expressions."""
    blocks = [scene.blocks[i] for i in scene.free.tolist()]
    own, every = np.array([block.weight for block in blocks]), sp.eye_array(len(blocks))
    repeated = sp.csr_array(sp.kron(every, np.ones((3, 1))))
    spread = sp.csr_array(sp.kron(every, np.eye(DOF, 3)))  # forces at centroids
    columns = sp.csr_array(sp.kron(every, np.ones((DOF, 1))))

    def acting(load: Load, forces: FloatArray) -> Any:
        if weights is None:
            return forces.ravel()
        per_weight = sp.csr_array(sp.diags_array(load.per_weight(blocks).ravel()) @ columns)
        return per_weight @ weights + (forces.ravel() - per_weight @ own)

    def expressed(name: str) -> Any:
        load = given[name]
        if isinstance(load, Sequence):
            load = cp.hstack(list(load))
        _refuse_variables(name, load)
        if not isinstance(load, cp.Expression):
            load = cp.Constant(np.asarray(load, dtype=float))
        if load.shape == (len(blocks), DOF):
            return cp.vec(load, order="C")
        if load.shape == (DOF * len(blocks),):
            return load
        if load.shape != (3,):
            raise ModelError(
                f"{name} must be a Load, an acceleration of three numbers or Parameters, or forces "
                f"({len(blocks)}, 6) on the free blocks, got shape {load.shape}"
            )
        three = sp.csr_array(np.tile(np.eye(3), (len(blocks), 1)))
        each = np.repeat(own, 3) if weights is None else repeated @ weights
        return spread @ cp.multiply(each, three @ load)

    dead = expressed("dead") if "dead" in given else acting(scene.dead, scene.dead_forces)
    live = expressed("live") if "live" in given else acting(scene.live, scene.live_forces)
    return dead, live


def _with_tension(whole: Assemblage, given: Given, joints: Mapping[str, Any]) -> Given:
    """What surfaces see: strengths and bounds as they were given, mortar's tension, and what pushes
    at least so much, as a dead load besides (:class:`~cvxlimit.model.mortar.Mortar`)."""
    contacts, names = given.contacts, (*PROPERTIES, "least", "most")
    values = {name: joints.get(name, getattr(contacts, name)) for name in names}
    tension, least = values["tensile_strength"], values["least"]
    has_tension, has_least = (isinstance(x, cp.Expression) or np.any(x) for x in (tension, least))
    if not (joints or has_tension or has_least):
        return given
    dead, seen, pull = given.dead, copy(contacts), np.zeros(len(contacts))
    if has_tension:
        strength = values["compressive_strength"]
        if isinstance(tension, cp.Expression) and not isinstance(strength, cp.Expression):
            # no expression is infinite: that of joints that do not crush is not looked at
            seen.__dict__["crushes"] = crushes = np.isfinite(strength)
            strength = np.where(crushes, strength, 0.0)
        values["cohesion"] = values["cohesion"] - product(values["friction"], tension)
        values["compressive_strength"] = strength + tension
        values["tensile_strength"] = np.zeros(len(contacts))
        pull = product(contacts.area, tension)
    if has_least:
        most = values["most"]
        if isinstance(least, cp.Expression):
            most = _finite(contacts, most)
        values["most"] = most - least
        values["least"] = np.zeros(len(contacts))
        pull = pull - product(contacts.sense, least)
    dead = dead - whole.statics.matrix[:, COLUMN["N"] :: len(COMPONENTS)] @ pull
    seen.__dict__.update(values, take=contacts.take)
    shown = pull if has_tension or has_least else None
    return Given(seen, dead, given.live, shown)

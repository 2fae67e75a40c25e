"""Scenes: blocks, supports, friction, dead and live loads. Immutable; ``with_...`` copies."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection
from dataclasses import KW_ONLY, dataclass, fields, replace
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvxlimit.base.arrays import FloatArray, RemadeFromFields
from cvxlimit.base.checks import members, of_type, positive
from cvxlimit.base.doors import attached
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.contacts import Contacts
from cvxlimit.geometry.detection import Detection, detect
from cvxlimit.geometry.lumped import Lumped, lumped_at
from cvxlimit.geometry.nearmisses import NearMiss, near_miss_sentence
from cvxlimit.geometry.strengths import PROPERTIES, ByPair, SceneJoints
from cvxlimit.scene.doubts import doubts
from cvxlimit.scene.loads import GRAVITY, Load
from cvxlimit.scene.reactions import Reaction, Tie, check_reactions, with_reactions
from cvxlimit.scene.settling import SupportMotion, check_motions
from cvxlimit.scene.supported import check_supported
from cvxlimit.scene.units import DEFAULT_UNITS, Units


@dataclass(frozen=True, eq=False)
class Scene(RemadeFromFields, SceneJoints):
    """What is to be analysed: blocks, which of them are fixed, friction, and two load cases.

    Attributes
    ----------
    blocks : tuple of Block
        Free and fixed blocks; order gives the rows of mechanisms.
    supports : tuple of str
        Ids of fixed blocks (the ground is one); a single id may stand alone.
    live : Load
        Multiplied by the unknown load factor.
    dead : Load
        Always there; self-weight along -z unless given.
    friction, cohesion, compressive_strength, tensile_strength : float
        Values of all contacts without an exception, see
        :class:`~cvxlimit.geometry.strengths.JointValues`. By default 0.7 (tan 35 degrees, as in all
        generators of :mod:`cvxlimit.masonry`), 0, infinite and 0. Scene files and imports must
        state friction; ``repr(scene)`` and the command line's summary show it.
    contact_friction, contact_cohesion, ... : mapping of (id, id) to float
        Exceptions: that of the contacts between two blocks, in either order.
    units : Units
    name : str
    ties : tuple of Tie
        Members that bear tension; each counts as a contact, after all others.
    reactions : tuple of Reaction
        Forces between bounds, as of soil that resists; each counts as a contact, after the ties.
    settling : tuple of SupportMotion
        How supports move where :func:`cvxlimit.settlement` is not told; a load factor is that of
        supports at rest.
    joint_tolerance : float or None
        How far apart, and how deep in each other, faces of different blocks may be and still be
        a contact (length). None: one hundredth of the mean thickness of the thinner block.

    Raises
    ------
    InputError
        For duplicate or unknown ids, a free block without density, no support, no free block, a
        live load that is zero everywhere, friction that is negative or not finite, anything that is
        not of its kind. Geometric faults (overlap, loose blocks) are found with the contacts.

    Example
    -------
    >>> ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    >>> tower = Block.box("tower", (0, 0, 0), (1, 1, 4), density=20.0)
    >>> scene = Scene([ground, tower], ["ground"], Load(acceleration=(1, 0, 0)), friction=0.7)
    >>> len(scene.contacts), scene.total_weight
    (1, 80.0)
    """

    blocks: tuple[Block, ...]
    supports: tuple[str, ...]
    live: Load
    dead: Load = GRAVITY
    _: KW_ONLY
    units: Units = DEFAULT_UNITS
    name: str = "scene"
    joint_tolerance: float | None = None
    ties: tuple[Tie, ...] = ()
    reactions: tuple[Reaction, ...] = ()
    settling: tuple[SupportMotion, ...] = ()

    def __post_init__(self) -> None:
        self._check({each.name for each in fields(self)})
        if not self.supports:
            raise InputError(
                f"scene {self.name!r} has no support, so that nothing can stand: name the fixed "
                f"blocks in its supports, as [{self.blocks[0].id!r}], or add a ground and name that"
            )

    def _check(self, changed: Collection[str]) -> None:
        """Refuse what is wrong in, or with, the fields that have changed."""
        for name, kind, what, cure in (
            ("blocks", Block, "blocks must be Blocks", "Block.box makes one"),
            ("supports", str, "supports must be ids", "write ['ground']"),
            ("ties", Tie, "ties must be Ties", "import Tie"),
            ("reactions", Reaction, "reactions must be Reactions", "import Reaction"),
            ("settling", SupportMotion, "settling must be SupportMotions", "import SupportMotion"),
        ):
            if name in changed:
                object.__setattr__(self, name, members(getattr(self, name), kind, what, cure))
        of_type(self.name, str, "name of the scene must be a text")
        of_type(self.units, Units, "units of the scene must be Units", 'write Units("mm", "N")')
        for case in ("live", "dead"):
            cure = "write Load(acceleration=(1, 0, 0)), or Load() for none"
            of_type(getattr(self, case), Load, f"the {case} load must be a Load", cure)
        others = {*changed} - self.joint_values.keys()
        known, fixed = {block.id for block in self.blocks}, set(self.supports)
        if len(others) < len(changed) or "blocks" in changed:
            self._check_joints(known)
        if "joint_tolerance" in changed and self.joint_tolerance is not None:
            length = positive(self.joint_tolerance, "joint_tolerance of the scene")
            object.__setattr__(self, "joint_tolerance", length)
        if others & {*_SHAPES, "ties", "reactions"}:
            check_supported(self.blocks, self.supports, self.name)
            check_reactions(self.ties, self.reactions, known, fixed)
        if "settling" in others:
            check_motions(self.settling, self.supports, self.name)
        if others & {*_SHAPES, "dead", "live"}:
            self.dead.check_blocks("dead", known, fixed)
            self.live.check_blocks("live", known, fixed)
            if not np.any(self.live_forces):
                raise InputError(
                    "the live load is zero everywhere: give it an acceleration or forces on free "
                    "blocks (an acceleration needs blocks with weight)"
                )

    def __repr__(self) -> str:
        """One line: name, numbers of blocks, friction."""
        free, fixed = len(self.free), len(self.blocks) - len(self.free)
        blocks = f"{free} free block{'s' * (free != 1)}, {fixed} support{'s' * (fixed != 1)}"
        return f"Scene({self.name!r}: {blocks}, friction {self.friction:g})"

    def _repr_html_(self) -> str:
        return str(attached("scene_html")(self))

    @cached_property
    def contacts(self) -> Contacts:
        """All contacts, detected on first use and kept; see :func:`detect`."""
        if (given := self.__dict__.get("_given_contacts")) is not None:
            return given
        detected = self._given_to(self._detection.contacts)
        if not (self.ties or self.reactions):
            return detected
        size = float(np.median([self.blocks[i].size for i in self.free]))
        return with_reactions(detected, self.ties, self.reactions, self.supports, size)

    @property
    def near_misses(self) -> tuple[NearMiss, ...]:
        """Pairs of faces that nearly form a joint; found with the contacts."""
        return self._detection.near_misses

    @property
    def near_miss_note(self) -> str:
        """One line with the number of near misses and the nearest; empty if there are none."""
        return near_miss_sentence(self.near_misses, self.units.length)

    @cached_property
    def lumped(self) -> Lumped | None:
        """Faces that contacts take as planes that they are not in; None without any."""
        return lumped_at(self.contacts) if self.contacts.lumped.any() else None

    @cached_property
    def doubts(self) -> tuple[str, ...]:
        """A sentence each on lengths and friction that look as if they were in another unit."""
        return tuple(doubts(self))

    @property
    def told(self) -> tuple[str, ...]:
        """What detection leaves out or simplifies, and numbers in doubt, a sentence each."""
        return tuple(filter(None, (self.near_miss_note, str(self.lumped or ""), *self.doubts)))

    @cached_property
    def _detection(self) -> Detection:
        return detect(self.blocks, self.supports, self.friction, self.joint_tolerance, self._tied)

    @property
    def _tied(self) -> frozenset[str]:
        both = [*((tie.a, tie.b) for tie in self.ties), *((r.block, r.on) for r in self.reactions)]
        return frozenset(name for pair in both for name in pair if name is not None)

    @cached_property
    def free(self) -> NDArray[np.int64]:
        """Indices of the free blocks in ``blocks``."""
        fixed = set(self.supports)
        return np.array([i for i, b in enumerate(self.blocks) if b.id not in fixed])

    @cached_property
    def dead_forces(self) -> FloatArray:
        """Dead load on the free blocks (n_free, 6), about their centroids."""
        return self.dead.on(self.blocks[i] for i in self.free)

    @cached_property
    def live_forces(self) -> FloatArray:
        """Live load on the free blocks (n_free, 6), for load factor 1."""
        return self.live.on(self.blocks[i] for i in self.free)

    @cached_property
    def total_weight(self) -> float:
        """Weight of all free blocks."""
        return float(sum(self.blocks[i].weight for i in self.free))

    def with_live(self, live: Load) -> Scene:
        """The same scene under another live load; contacts are kept."""
        return self._copy(live=live)

    def with_dead(self, dead: Load) -> Scene:
        """The same scene under another dead load; contacts are kept."""
        return self._copy(dead=dead)

    def with_joints(self, **values: float | ByPair | None) -> Scene:
        """The same scene with other friction, cohesion or strengths; contacts are kept.

        Parameters
        ----------
        values : float or mapping
            ``friction=0.5``, ``contact_friction={("b1", "b2"): 0.2}`` and so on, as for the scene
            itself; what is not given, or None, stays.

        Raises
        ------
        InputError
            For a name that is none of theirs, for values that a scene refuses, and where contacts
            have values of their own, as of the solution of a :class:`~cvxlimit.LimitProblem`.

        Example
        -------
        >>> from cvxlimit import builtin_scene
        >>> builtin_scene("single-block").with_joints(cohesion=2.0).contacts.cohesion.tolist()
        [2.0]
        """
        for name in (each for each in values if each not in self.joint_values):
            raise InputError(f"contacts have no {name!r}: they have {', '.join(PROPERTIES)}")
        self._refuse_given("other strengths")
        return self._copy(**{name: value for name, value in values.items() if value is not None})

    def with_friction(self, friction: float, contact_friction: ByPair | None = None) -> Scene:
        """The same scene with other friction; ``contact_friction`` None keeps the exceptions."""
        return self.with_joints(friction=friction, contact_friction=contact_friction)

    def with_cohesion(self, cohesion: float) -> Scene:
        """The same scene with other cohesion (force per area); exceptions are kept."""
        return self.with_joints(cohesion=cohesion)

    def with_strength(
        self, compressive: float | None = None, tensile: float | None = None
    ) -> Scene:
        """The same scene with other strengths (force per area); None and exceptions are kept."""
        return self.with_joints(compressive_strength=compressive, tensile_strength=tensile)

    def with_density(self, factor: float) -> Scene:
        """The same scene with all densities times a factor; contacts are kept."""
        times = positive(factor, "factor on all densities")
        blocks = tuple(
            b if b.density is None else replace(b, density=times * b.density) for b in self.blocks
        )
        return self._copy(blocks=blocks)

    def with_name(self, name: str) -> Scene:
        """The same scene under another name."""
        return self._copy(name=name)

    def moved(self, rotation: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> Scene:
        """The scene after x -> rotation @ x + translation, loads included.

        Raises
        ------
        InputError
            As :meth:`with_joints`, of contacts with values of their own.
        """
        self._refuse_given("another position")
        turn, shift = (np.asarray(x, dtype=float) for x in (rotation, translation))
        return replace(
            self,
            blocks=tuple(b.moved(turn, shift) for b in self.blocks),
            dead=self.dead.moved(turn, shift),
            live=self.live.moved(turn, shift),
            ties=tuple(t.moved(turn, shift) for t in self.ties),
            reactions=tuple(r.moved(turn, shift) for r in self.reactions),
            settling=tuple(x.moved(turn, shift) for x in self.settling),
        )

    @classmethod
    def from_compas(
        cls, model: Any, *, friction: float, live: Any = None, length_unit: str = "m",
        up: str = "z", **options: Any,
    ) -> Scene:  # fmt: skip
        """The scene of a model of compas_dem or compas_model, of an assembly, or of meshes.

        Blocks have the numbers of the model's graph as names; ``solution.to_compas(model)`` gives
        results back. Features and modifiers are applied. Supports are those that the model marks.
        Materials have kg/m³, which become weights per volume in kN and m, N and mm and so on.

        Of a file, :func:`cvxlimit.io.import_geometry` makes a scene, and the arguments are its:
        ``density``, ``supports`` and others; without ``live`` a push along x.

        Raises
        ------
        InputError
            If an element is no block, or the model says no supports or no densities.
        """
        given = {"friction": friction, "length_unit": length_unit, "up": up}
        return attached("scene_from_compas")(model, live, **given, **options)

    def explain(self, surface: Any = "conic", **options: Any) -> Any:
        """Size of the model that ``solve`` uses, solver, expected times; nothing is solved.

        Parameters, result and errors are those of :func:`cvxlimit.reductions.explaining.explain`.
        """
        return attached("scene_explain")(self, surface, **options)

    def in_units(self, units: Units, length: float, force: float) -> Scene:
        """The scene in other units: lengths times ``length``, forces times ``force``.

        From m and kN to mm and N: ``scene.in_units(Units("mm", "N"), 1e3, 1e3)``.

        Raises
        ------
        InputError
            If a factor is not a finite number above 0, and as :meth:`with_joints`, of contacts with
            values of their own.
        """
        self._refuse_given("other units")
        of_type(units, Units, "units must be Units", 'write Units("mm", "N")')
        length = positive(length, "length, how many new units one old unit of length is,")
        force = positive(force, "force, how many new units one old unit of force is,")
        return replace(
            self,
            blocks=tuple(b.scaled(length, force / length**3) for b in self.blocks),
            dead=self.dead.scaled(length, force),
            live=self.live.scaled(length, force),
            units=units,
            **self._scaled_joints(force / length**2),
            ties=tuple(tie.scaled(length, force) for tie in self.ties),
            reactions=tuple(r.scaled(length, force) for r in self.reactions),
            settling=tuple(motion.scaled(length) for motion in self.settling),
            joint_tolerance=None if self.joint_tolerance is None else length * self.joint_tolerance,
        )

    def plot(
        self,
        path: str | os.PathLike[str] | None = None,
        viewer: tuple[float, float, float] | None = None,
        **options: Any,
    ) -> Any:
        """Draw the scene before it is solved: blocks, supports, joints, loads, near misses.

        Without ``path`` it is a Matplotlib figure, which notebooks show; with one, a file is
        written, see :func:`cvxlimit.plotting.plot_scene`. ``viewer``, ``ax``, ``figsize``,
        ``title`` and ``legend`` are those of :func:`cvxlimit.plotting.scene_figure`. A scene whose
        geometry is refused is drawn too.
        """
        options |= {} if viewer is None else {"viewer": viewer}
        if path is None:
            return attached("scene_figure")(self, **options)
        return attached("scene_file")(self, path, **options)

    def _copy(self, **changes: object) -> Scene:
        """A copy with changes that leave all shapes as they are; settlement frees a support."""
        copy = object.__new__(type(self))
        copy.__dict__.update({each.name: getattr(self, each.name) for each in fields(self)})
        copy.__dict__.update(changes)
        for name, parts in _FOLLOW_FROM.items():  # before the checks, which ask for some of these
            if name in self.__dict__ and not parts & changes.keys():
                copy.__dict__[name] = self.__dict__[name]
        copy._check(changes.keys())
        return copy

    def _beside(self, name: str, value: object) -> Scene:
        """The same scene, whose contacts follow from something else."""
        copy = object.__new__(type(self))
        kept = {k: v for k, v in vars(self).items() if k not in ("contacts", "lumped")}
        copy.__dict__.update(kept, **{name: value})
        return copy

    @cached_property
    def geometry(self) -> str:
        """Fingerprint of all that determines contacts: equal for scenes with the same contacts.

        Shapes and ids of blocks, supports, joint tolerance, where ties and reactions act; not
        density, friction, loads and what ties and reactions bear.
        """
        digest = hashlib.blake2b(digest_size=16)
        ends = [(tie.a, tie.b, tie.start, tie.end) for tie in self.ties]
        pushes = [
            (r.block, r.on, r.at, r.direction, r.most > 0.0, r.least < 0.0) for r in self.reactions
        ]
        digest.update(repr((self.supports, self.joint_tolerance, ends, pushes)).encode())
        for block in self.blocks:
            digest.update(repr((block.id, block.faces)).encode())
            digest.update(block.vertices.tobytes())
        return digest.hexdigest()

    def sharing_contacts_of(self, other: Scene) -> Scene:
        """The same scene with the contacts found in ``other``, which are not sought again.

        Raises
        ------
        InputError
            If the two do not have the same blocks, supports, joint tolerance and tied blocks.
        """
        about = attrgetter("supports", "joint_tolerance", "_tied")
        same = self.blocks is other.blocks and about(self) == about(other)
        if not same and self.geometry != other.geometry:
            raise InputError(
                f"scenes {self.name!r} and {other.name!r} differ in their blocks, supports, "
                "tied blocks or joint tolerance, and so in their contacts"
            )
        return self._beside("_detection", other._detection)

    def _with_contacts(self, contacts: Contacts) -> Scene:
        """The same scene with these contacts in place of those detected, for what solves it: files
        and pickles know nothing of them; other units and other strengths are refused."""
        return self._beside("_given_contacts", contacts)

    def _refuse_given(self, change: str) -> None:
        """Raises InputError where a change would miss contacts that have values of their own."""
        if "_given_contacts" in self.__dict__:
            raise InputError(
                f"contacts of scene {self.name!r} have values of their own, as a LimitProblem "
                f"gives, which {change} would not reach: change the scene that it was made of"
            )


_SHAPES = frozenset({"blocks", "supports"})
_JOINTS = frozenset(name for what in PROPERTIES for name in (what, f"contact_{what}"))
_FOLLOW_FROM: dict[str, frozenset[str]] = {
    "_detection": frozenset(),
    "_given_contacts": frozenset(),
    "geometry": _SHAPES,
    "free": _SHAPES,
    "dead_forces": _SHAPES | {"dead"},
    "live_forces": _SHAPES | {"live"},
    "contacts": _SHAPES | {"joint_tolerance", "ties", "reactions"} | _JOINTS,
}
"""What a copy keeps, unless one of these is changed."""


def check_scene(value: Any) -> None:
    """Refuse anything but a scene, and say how to make one."""
    if isinstance(value, Scene):
        return
    cure = "builtin_scene('arch') makes one"
    if isinstance(value, str):
        cure = f"write builtin_scene({value!r}), or read_scene({value!r}) if it is a file"
    of_type(value, Scene, "scene must be a Scene", cure)

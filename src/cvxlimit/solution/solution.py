"""What comes out: a load factor, its bracket, contact forces, mechanism and history."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.doors import attached
from cvxlimit.errors import InputError
from cvxlimit.geometry.lumped import Lumped
from cvxlimit.scene import Scene, Units, check_scene
from cvxlimit.solution.bracket import Bracket, Evidence, Reference, rounded, rounded_up
from cvxlimit.solution.from_rest import FromRest, Step
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.solution.records import Iterate, Iteration, LowerEnd, Member, Search, Status
from cvxlimit.surfaces import YieldSurface

if TYPE_CHECKING:
    from pandas import DataFrame

Table = Literal["contacts", "blocks", "history", "steps"]

LOAD_FACTOR = "load factor"
"""What a solution is about unless it says otherwise."""


@dataclass(frozen=True, eq=False)
class Solution:
    """Result of an analysis: plain numbers and NumPy arrays, and the scene that was solved.

    Pickles, and goes to JSON (without the scene). Notebooks show it with a picture and its bracket.

    Attributes
    ----------
    scene_name : str
    surface : str
        ``"conic"``, ``"octagon"``, ``"16-gon"`` ...
    interaction : str
        ``"none"``, ``"fixed-point"`` or ``"certified"``.
    moments : str
        Name of the reading of Eq. 30, ``"independent"`` for example; matters with interaction only.
    blocks, contacts : int
        Numbers of free blocks and of contacts.
    load_factor : float or None
        The method's value, inside its bracket if it has one. None when no answer exists, and where
        nothing holds the value: no bracket, no member, and an iteration that did not converge,
        whose load factors :attr:`history` and :attr:`iteration` have.
    bracket : Bracket
        Bounds of the load factor asked for, recomputed outside the solver; infinite where the
        method has none.
    status : Status
    history : tuple of Iterate
    seconds : mapping
        ``detect``, ``compile``, ``solve``, ``certify`` and ``total``.
    forces : (contacts, 6) array or None
        V1, V2, N, M1, M2, MT on block b of each contact, user's units.
    mechanism : mapping of block id to (6,) array, or None
        ux, uy, uz, rx, ry, rz rates of the free blocks at their centroids, scaled to live
        power 1.
    note : str
        What the status rests on, in a sentence; empty if there is nothing to add.
    versions : mapping of distribution to version
        cvxlimit, CVXPY and every solver that ran.
    torsion_shear : str
        ``"linear"`` (the paper's), ``"parabolic"`` or ``"exact"``: what the first surface says that
        limits both together; empty where none says any.
    flow : str
        ``"associated"`` or ``"zero-dilatancy"``.
    members : tuple of Member
        All solutions found, lowest first, where the answer is a set: zero dilatancy.
    searches : tuple of Search
        What each search for them found, and how late.
    dilatancy : Dilatancy or None
        How far the load factor rests on joints that open because they slide; None without forces
        and mechanism, and where friction does not dilate (``flow``).
    from_rest : FromRest or None
        Of method ``"incremental"``: how the way ended, what may be to come, where it ends besides.
    iteration : Iteration or None
        Where the paper would have stopped and the band of the last iterates, of the fixed point.
    internal : (p,) array or None
        Internal forces behind the lower bound, where strength is stated in these: the pressures on
        cells of contacts that crush, for example.
    lower_end : LowerEnd or None
        The lower end, where the dead load stands only together with a part of the live load, and
        ``load_factor`` is the upper end; None where it stands alone.
    reference : Reference or None
        What bounds were computed with beside forces and mechanism, without interaction; None for a
        file of a version below 0.3.
    beside : mapping of str to Evidence
        What else is proved by forces or rates of its own, by claim: ``"associated"``, the upper
        bound of all solutions without dilatancy; ``"slides"``, a solution without dilatancy where
        any multiple is carried with it; ``"thrusts 1"``, ``"excluded 1"`` and so on, in this
        order, below which load factor there is none; ``"points"``, the lower bound of method
        ``"exact"``. Of the scene as it was solved, where mortar may have become a load.
    model : tuple of str
        Reductions of the model that were used: ``"parts"``, ``"symmetry"``, ``"planar"``; none for
        the full one.
    quantity : str
        Quantity of ``load_factor`` and the bracket: the load factor, or a support's reaction.
    contact_names : tuple of str
        In the order of ``forces``; empty for a file of a version below 0.2.
    scene_digest : str
        Of a file, the digest of its scene (:func:`~cvxlimit.io.scene_digest`); else empty.
    tolerance : float or None
        Width of the bracket, or change of an iteration, that was asked for; None where none was.
    units : Units or None, lumped : Lumped or None
        As of the scene; None for files of versions below 0.2 and below 0.3.
    solved_scene : Scene or None
        What was solved; None for a solution read from a file. What needs the scene raises
        InputError until :meth:`of` gives it.
    surfaces : tuple of YieldSurface
        What limited the contact forces; empty for a solution read from a file. Strength
        that a formulation states itself (friction at corners, stone that crushes) is not among
        them, and not in the utilisation of tables and pictures.
    """

    format: ClassVar[str] = "cvxlimit-result"

    scene_name: str
    surface: str
    interaction: str
    moments: str
    blocks: int
    contacts: int
    load_factor: float | None
    bracket: Bracket
    status: Status
    history: tuple[Iterate, ...]
    seconds: Mapping[str, float]
    forces: FloatArray | None = field(default=None, repr=False)
    mechanism: Mapping[str, FloatArray] | None = field(default=None, repr=False)
    note: str = ""
    versions: Mapping[str, str] = field(default_factory=dict, repr=False)
    torsion_shear: str = "linear"
    flow: str = "associated"
    members: tuple[Member, ...] = field(default=(), repr=False)
    searches: tuple[Search, ...] = field(default=(), repr=False)
    dilatancy: Dilatancy | None = None
    iteration: Iteration | None = None
    internal: FloatArray | None = field(default=None, repr=False)
    lower_end: LowerEnd | None = None
    reference: Reference | None = field(default=None, repr=False)
    beside: Mapping[str, Evidence] = field(default_factory=dict, repr=False)
    model: tuple[str, ...] = ()
    quantity: str = LOAD_FACTOR
    solved_scene: Scene | None = field(default=None, repr=False)
    surfaces: tuple[YieldSurface, ...] = field(default=(), repr=False)
    contact_names: tuple[str, ...] = field(default=(), repr=False)
    scene_digest: str = field(default="", repr=False)
    units: Units | None = None
    lumped: Lumped | None = None
    tolerance: float | None = None
    from_rest: FromRest | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        scene = self.solved_scene
        if scene is not None:  # what files have of it
            names = scene.contacts.names
            self.__dict__.update(contact_names=names, units=scene.units, lumped=scene.lumped)

    def __repr__(self) -> str:
        """One line: what was solved, the load factor, its bracket, how it ended."""
        what = f"{self.scene_name!r}, {self.surface_name}"
        if self.interaction != "none":
            what += f", {self.interaction} interaction, {self.moments} moments"
        if self.load_factor is None:
            return f"Solution({what}: {self.range_text or self.standing})"
        inside = f" in {self.bracket}" if self.bracket.has_any else ""
        value = f"{self.quantity} {self.range_text or rounded(self.load_factor)}"
        return f"Solution({what}: {value}{inside}, {self.standing})"

    @property
    def surface_name(self) -> str:
        """The surface as it is called where it is chosen, ``"parabolic"`` among them, and
        ``"exact"`` for the exact limit of torsion and shear."""
        is_named = self.surface == "conic" and self.torsion_shear not in ("linear", "")
        return self.torsion_shear if is_named else self.surface

    @property
    def advice(self) -> str:
        """What the status means and what to do; the note where that would be to use the method that
        has just been used."""
        general = self.status.advice
        return self.note if f"'{self.flow}'" in general else general

    @property
    def standing(self) -> str:
        """The status, and the width of the bracket with interaction, or of the last iterates."""
        width = 0.0 if self.interaction == "none" else self.gap
        if self.iteration is not None:
            if not self.status.is_good:
                return f"{self.status}, {self.iteration.band}"
            width = self.iteration.width
        if self.is_answered and not self.status.is_good:
            return "certified, without an upper end"
        if self.dilatancy is not None and self.dilatancy.is_all:
            return f"{self.status}, {self.dilatancy.known} without it"
        if width <= 1e-6 or not self.status.is_good:
            return str(self.status)
        return f"{self.status} within {rounded_up(100.0 * width, 2)} %"

    @property
    def lower(self) -> float:
        """Lower end of the bracket; -inf without one."""
        return self.bracket.lower

    @property
    def upper(self) -> float:
        """Upper end of the bracket; inf without one."""
        return self.bracket.upper

    @cached_property
    def evidence(self) -> Evidence:
        """What the bracket is proved by: forces, load factor, rates, a state inside and an opening
        field. What rests on others of its own is in :attr:`beside`.

        Example
        -------
        A block of 0.4 by 1 m carries 0.4 of its weight about its edge, 0.2 m from the centre:

        >>> from cvxlimit import builtin_scene, solve
        >>> found = solve(builtin_scene("single-block"))
        >>> v1, v2, n, m1, m2, mt = found.evidence.forces[0]
        >>> print(f"{abs(v1) / n:.6f} {abs(m2) / n:.6f} {found.evidence.load_factor:.6f}")
        0.400000 0.200000 0.400000
        """
        rates = None if self.mechanism is None else np.array([*self.mechanism.values()])
        return Evidence(self.load_factor, self.forces, rates, self.internal, self.reference)

    @property
    def steps(self) -> tuple[Step, ...]:
        """The states from rest to the end of the curve; empty for other methods than
        ``"incremental"``."""
        return () if self.from_rest is None else self.from_rest.steps

    @property
    def interval(self) -> tuple[float, float] | None:
        """Least and largest load factor that are carried, the latter infinite if any are, where
        the dead load stands only together with a part of the live load; else None.

        Example
        -------
        >>> from cvxlimit import Block, Load, Scene, solve
        >>> blocks = [Block.box("ground", (0, 0, -1), (1, 1, 0))]
        >>> blocks += [Block.box("slab", (0, 0, 0), (1, 1, 0.5), density=20.0)]
        >>> leaning = Load(gravity=(0, 0, -1), acceleration=(0.6, 0, 0))  # beyond friction of 0.5
        >>> back = Load(acceleration=(-1, 0, 0))
        >>> solution = solve(Scene(blocks, ["ground"], back, leaning, friction=0.5))
        >>> [round(end, 6) for end in solution.interval]
        [0.1, 1.1]
        """
        if self.lower_end is None:
            return None
        largest = float("inf") if self.load_factor is None else self.load_factor
        return self.lower_end.load_factor, largest

    @property
    def quantity_unit(self) -> str:
        """Unit of the load factor and its bracket: none, or that of a reaction or a moment."""
        if self.quantity == LOAD_FACTOR or self.units is None:
            return ""
        force, length = self.units.force, self.units.length
        # "least moment of": ids of supports, which may be any words, follow
        return f"{force} {length}" if self.quantity.split()[1:2] == ["moment"] else force

    @property
    def range_text(self) -> str:
        """The interval in words; empty if the dead load stands alone."""
        if self.interval is None:
            return ""
        low, high = (f"{end:.6g}" for end in self.interval)
        more = " and more" if self.is_answered else " and more with dilatancy"
        return low + more if self.load_factor is None else f"{low} to {high}"

    @property
    def is_answered(self) -> bool:
        """True when the status is good, or the lower end is, and any more proved to do no harm."""
        is_harmless = self.status is Status.LIVE_LOAD_HARMLESS
        return self.status.is_good or (self.lower_end is not None and is_harmless)

    @property
    def gap(self) -> float:
        """Relative width of the bracket; infinite without one."""
        return self.bracket.width

    @property
    def is_proved(self) -> bool:
        """True if neither bound rests on an assumption about the size of forces or rates."""
        return self.bracket.is_proved

    def __getstate__(self) -> dict[str, Any]:
        """Leaves out the problem, and surfaces of a script, a notebook or a function: whoever
        unpickles must be able to import the module of a surface."""
        kept = {name: value for name, value in vars(self).items() if name != "problem"}
        for kind in map(type, self.surfaces):
            if kind.__module__ == "__main__" or "<locals>" in kind.__qualname__:
                kept["surfaces"] = ()
        return kept

    def of(self, scene: Scene, surfaces: Sequence[YieldSurface] = ()) -> Solution:
        """The same solution with its scene, which tables and pictures need.

        Surfaces of one's own are needed besides where the share of strength in use is asked for.

        Raises
        ------
        InputError
            If the scene has another number of free blocks or contacts, or other blocks.
        """
        check_scene(scene)
        free = [scene.blocks[i].id for i in scene.free]
        if self.quantity != LOAD_FACTOR:  # supports that give way move, too
            free += [name for name in scene.supports if name in (self.mechanism or ())]
        for what, own, found in (
            ("free blocks", self.blocks, len(free)),
            ("contacts", self.contacts, len(scene.contacts)),
        ):
            if own != found:
                raise InputError(
                    f"the solution of {self.scene_name!r} has {own} {what}, but scene "
                    f"{scene.name!r} has {found}: it does not belong to it"
                )
        if self.mechanism is not None and not set(free) <= set(self.mechanism):
            missing = min(set(free) - set(self.mechanism))
            raise InputError(
                f"the mechanism lacks block {missing!r}: the solution of {self.scene_name!r} "
                f"does not belong to scene {scene.name!r}"
            )
        return replace(self, solved_scene=scene, surfaces=tuple(surfaces) or self.surfaces)

    @property
    def scene(self) -> Scene:
        """The scene that was solved.

        Raises
        ------
        InputError
            For a solution read from a file, until :meth:`of` gives it its scene.
        """
        if self.solved_scene is None:
            raise InputError(
                f"the solution of {self.scene_name!r} has no scene, since files do not hold it: "
                "solution.of(scene) gives it back"
            )
        return self.solved_scene

    @cached_property
    def problem(self) -> Any:
        """The :class:`~cvxlimit.LimitProblem` without interaction, of which this is a solution: the
        one that was solved, or the one of its scene and surfaces; to change, and to solve again. Of
        a way from rest it is one step
        (:class:`~cvxlimit.extensions.incremental.stating.ElasticStep`).

        Example
        -------
        >>> from cvxlimit import builtin_scene, solve
        >>> problem = solve(builtin_scene("single-block")).problem
        >>> limit = problem.add("prop", problem.V1 >= -1.0)
        >>> round(problem.solve().load_factor, 4)
        0.3125
        """
        return attached("solution_problem")(self)

    def sensitivity(self) -> Any:
        """What the load factor gains per unit of friction, strength, weight, load, and position of
        every vertex: from the forces and the mechanism of this solution, without another solve.
        The ``note`` of the :class:`cvxlimit.results.sensitivity.Sensitivity` says what the
        derivatives rest on.

        Raises
        ------
        InputError
            For a solution without its scene, forces or mechanism, and for one that is no optimum
            of one convex problem: with interaction, without dilatancy.

        Example
        -------
        >>> from cvxlimit import builtin_scene, solve
        >>> found = solve(builtin_scene("tuff-wall")).sensitivity()
        >>> slopes, shares = found.friction, found.elasticity("friction")
        >>> round(float(slopes.sum()), 4), round(float(shares.sum()), 2)
        (0.9816, 1.18)
        """
        return attached("solution_sensitivity")(self)

    def to_dataframe(self, what: Table = "contacts") -> DataFrame:
        """The results as a table: a row per contact, per block, per solve, or per step from rest.

        ``"contacts"``: both blocks, forces V1 ... MT on the second, pressure centre, utilisation by
        surface, opening, slip and twist rates for live power 1. ``"blocks"``: weight, centroid,
        rates. ``"history"``: what every solver gave. ``"steps"`` of method ``"incremental"``: load
        factor over displacement, joints that slide and are open. ``table.attrs["units"]`` and
        ``table.attrs["description"]`` say what each column is. A solution read from a file has the
        columns of forces and rates alone, until :meth:`of` gives it its scene.

        Raises
        ------
        InputError
            For another table, steps of another method, or a solution of an older file, which names
            no contacts.
        ModelError
            If pandas is not installed.

        Example
        -------
        >>> from cvxlimit import builtin_scene, solve
        >>> solve(builtin_scene("single-block")).to_dataframe()["state"].iloc[0]
        'opens'
        """
        table: DataFrame = attached("solution_table")(self, what)
        return table

    def plot(
        self, kind: str = "mechanism", path: str | os.PathLike[str] | None = None, **options: Any
    ) -> Any:
        """Draw the result as a SceneFigure, Animation or Page; nothing is shown by itself, but
        notebooks show what ends a cell.

        Parameters
        ----------
        kind : str
            ``"mechanism"``, ``"forces"``, ``"thrust"`` and so on: a name in
            :data:`cvxlimit.plotting.PICTURES`, one's own among them.
        path : path or None
            With one, a file is written, and its path returned: ``.png``, ``.svg`` or ``.pdf``;
            ``.gif`` or ``.mp4``; ``.html`` for pages. The mechanism has ``.html`` and ``.vtu``.
        options
            Of the function of that name in :mod:`cvxlimit.plotting`, as ``viewer=(1, -1, 0.5)``.

        Raises
        ------
        InputError
            For another kind or suffix, or a solution without its scene.
        ModelError
            If Matplotlib is not installed.
        """
        return attached("solution_plot")(self, kind, path, **options)

    def to_compas(self, model: Any, largest: float | None = None) -> Any:
        """The results as compas_dem keeps and shows them: its ``Results`` for the model that
        :meth:`Scene.from_compas` made the scene of, which is not changed.

        Nodes have a ``transformation``: the collapse mechanism with a displacement ``largest`` of
        the fastest corner, a tenth of a typical joint's size unless given. Edges have
        ``contact_data``, whose ``forces`` at the corners have the contact's forces and moments as
        resultant (of several contacts of two blocks the one with the largest force; ``contacts``
        has all), ``resultant_global`` on the second node, and what else its ``DEMViewer`` reads.

        Raises
        ------
        InputError
            If a block is not where the model has it.
        ModelError
            If compas_dem is not installed.
        """
        return attached("solution_to_compas")(self, model, largest)

    def report(
        self, file: str | os.PathLike[str] | None = None, *, path: Any = None, check: Any = None,
        envelope: Any = None, sensitivity: Any = None, without_dilatancy: Solution | None = None,
        notes: Mapping[str, str] | None = None,
    ) -> Any:  # fmt: skip
        """One page that prints to two sheets of A4, to be read and signed: the result with its
        bracket and what that rests on, pictures of structure and mechanism, loads, joints, what was
        simplified or assumed, versions, the scene's digest and how to cite.

        Parameters
        ----------
        file : path or None
            Ends in ``.html``; its path is returned. Without it the page is, which notebooks show.
        path, check, envelope, sensitivity : optional
            Sections to add: what :func:`cvxlimit.pushover`, :func:`cvxlimit.code_check` and
            :func:`cvxlimit.envelope` return, a text, a mapping, or a table of pandas.
        without_dilatancy : Solution, optional
            Of method ``"zero-dilatancy"``, whose load factor is put beside this one.
        notes : mapping of str to str, optional
            Under ``"object"``, ``"author"`` and ``"place and date"`` the page's head; under
            ``"friction"``, ``"weight per volume"``, ``"earth and water"``, ``"ties"`` and
            ``"reactions"`` where these values come from; under other names what else is to stand
            there. What is not given is a line to fill in by hand.

        Raises
        ------
        InputError
            If the solution has no scene, or the file cannot be written.

        Example
        -------
        >>> from cvxlimit import builtin_scene, solve
        >>> page = solve(builtin_scene("dam")).report(check="Checked by hand: sliding at 1.057.")
        >>> "Checked by hand" in page
        True
        """
        given = {
            "path": path, "check": check, "envelope": envelope, "sensitivity": sensitivity,
            "without_dilatancy": without_dilatancy, "notes": notes,
        }  # fmt: skip
        return attached("solution_report")(self, file, given)

    def _repr_html_(self) -> str:
        return str(attached("solution_html")(self))

"""Solutions as pandas tables: contacts, blocks and history, each column with its unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import check_known
from cvxlimit.base.extras import needed
from cvxlimit.errors import InputError
from cvxlimit.geometry.contacts import COMPONENTS, pressure_centres
from cvxlimit.problem.interfaces import gains_by_contact
from cvxlimit.problem.problem import LimitProblem
from cvxlimit.results.derivatives import JOINTS
from cvxlimit.results.movement import motion
from cvxlimit.results.sensitivity import Sensitivity
from cvxlimit.results.utilisation import BENDING, contact_forces, utilisations
from cvxlimit.scene import Scene, Units
from cvxlimit.solution import Iterate, Solution
from cvxlimit.solution.kinematics import ContactKind

if TYPE_CHECKING:
    from pandas import DataFrame

Columns = dict[str, tuple[Any, str, str]]
"""Values, unit and description by column."""


def table_of(solution: Solution, what: str) -> DataFrame:
    """The table ``what`` of a solution: contacts, blocks or history."""
    check_known(what, _TABLES, "there is no table")
    pandas = needed("pandas", "frames", "tables")
    if what == "history":
        return _history(solution, pandas)
    if what == "steps":
        return _steps(solution, pandas)
    if solution.solved_scene is None and (solution.contact_names or what == "blocks"):
        index, columns = _read(solution, what)
    else:
        index, columns = _TABLES[what](solution, solution.scene)
    return table_from(pandas, index, columns, what.removesuffix("s"), _facts(solution))


def table_from(
    pandas: Any, index: Any, columns: Columns, name: str | None, facts: Any
) -> DataFrame:
    """The table of some columns; units, descriptions and ``facts`` are its ``attrs``."""
    table: DataFrame = pandas.DataFrame(
        {name: values for name, (values, _, _) in columns.items()},
        index=None if index is None else pandas.Index(index, name=name),
    )
    table.attrs = {
        **facts,
        "units": {name: unit for name, (_, unit, _) in columns.items() if unit},
        "description": {name: text for name, (_, _, text) in columns.items()},
    }
    return table


def sensitivity_table(found: Sensitivity, what: str) -> DataFrame:
    """See :meth:`Sensitivity.to_dataframe`."""
    made = {"contacts": _by_contact, "blocks": _by_block, "vertices": _by_vertex, "loads": _by_load}
    check_known(what, made, "there is no table")
    pandas = needed("pandas", "frames", "tables")
    index, columns = made[what](found, found.solution.scene)
    name = {"vertices": "block"}.get(what, what.removesuffix("s"))
    return table_from(pandas, index, columns, name, {**_facts(found.solution), "note": found.note})


def problem_table(problem: LimitProblem) -> DataFrame:
    """See :meth:`cvxlimit.LimitProblem.to_dataframe`."""
    pandas, stated = needed("pandas", "frames", "tables"), problem._stated
    contacts, units = stated.assemblage.contacts, stated.assemblage.scene.units
    values = [getattr(problem, name).value for name in COMPONENTS]
    none = np.full(len(contacts), np.nan)
    forces = np.stack([none if each is None else each for each in values], axis=1)
    a, b = zip(*stated.pairs, strict=True)
    columns: Columns = {
        "a": (a, "", "block out of which the normal points"),
        "b": (b, "", "block into which it points, and on which the forces act"),
    }
    columns |= _forces(forces, len(contacts), units)
    what = "the load factor" if stated.aim is None else "the aim"
    per = f"1/{units.force}" if stated.aim is None else ""
    for label, gain in gains_by_contact(stated.parts(), len(contacts)).items():
        text = f"what {what} gains per unit of force by which the contact resists more: {label}"
        columns[f"gain_{label}"] = gain, per, text
    facts = {"scene": stated.assemblage.scene.name, "status": problem.status}
    return table_from(pandas, contacts.names, columns, "contact", facts)


_SIDES = "slopes upwards and downwards differ, and these are between them: see both_sides"


def _by_contact(found: Sensitivity, scene: Scene) -> tuple[list[str], Columns]:
    columns: Columns = {}
    stress = f"{scene.units.length}\u00b2/{scene.units.force}"
    for name in JOINTS:
        text, unit = name.replace("_", " "), "" if name == "friction" else stress
        columns[f"by_{name}"] = getattr(found, name), unit, f"load factor per unit of its {text}"
        if found.solution.load_factor:
            columns[f"elasticity_{name}"] = (
                found.elasticity(name), "", f"per cent of the load factor for 1 % of its {text}",
            )  # fmt: skip
    sides = np.any([found.one_sided[name] for name in JOINTS], axis=0)
    columns["is_one_sided"] = sides, "", _SIDES
    return list(scene.contacts.names), columns


def _by_block(found: Sensitivity, scene: Scene) -> tuple[list[str], Columns]:
    force, moment = f"1/{scene.units.force}", f"1/({scene.units.force}\u00b7{scene.units.length})"

    def of_all(values: FloatArray) -> FloatArray:
        result = np.zeros((len(scene.blocks), *values.shape[1:]))
        result[scene.free] = values
        return result

    columns: Columns = {
        "by_weight": (of_all(found.weight), force, "load factor per unit of weight")
    }
    if found.solution.load_factor:
        text = "per cent of the load factor per per cent of the weight"
        columns["elasticity_weight"] = of_all(found.elasticity("weight")), "", text
    for case in ("dead", "live"):
        by = of_all(getattr(found, case))
        text = f"load factor per unit of a further {case} {{}} at the centroid"
        columns |= _along(f"by_{case}_f", by[:, :3], force, text.format("force along {}"))
        columns |= _along(f"by_{case}_m", by[:, 3:], moment, text.format("moment about {}"))
    text = "load factor per length by which the block alone moves along {}"
    columns |= _along("by_move_", found.moves, f"1/{scene.units.length}", text)
    return [b.id for b in scene.blocks], columns


def _by_vertex(found: Sensitivity, scene: Scene) -> tuple[list[str], Columns]:
    every = [(b.id, i) for b in scene.blocks for i in range(len(b.vertices))]
    at = np.concatenate([b.vertices for b in scene.blocks])
    by = np.concatenate([found.vertices[b.id] for b in scene.blocks])
    shared = np.concatenate([found.shared[b.id] for b in scene.blocks])
    per = f"1/{scene.units.length}"
    columns: Columns = {
        "vertex": ([i for _, i in every], "", "its number in the block"),
        **_along("", at, scene.units.length, "{} of the vertex"),
        **_along("by_", by, per, "load factor per length by which the vertex moves along {}"),
        "is_shared": (shared, "", "on an edge where two blocks end together: the mean of moving it "
                      "in and out, and with all that move along the sum"),
        "is_one_sided": (found.one_sided["vertices"], "", _SIDES),
    }  # fmt: skip
    return [name for name, _ in every], columns


def _by_load(found: Sensitivity, scene: Scene) -> tuple[list[int], Columns]:
    texts = {
        "case": "dead or live", "kind": "as Load names it", "block": "on which it acts, or all",
        "component": "of force, moment, multiple of weight, or point of application",
        "value": "as given", "derivative": "load factor per unit of the value",
    }  # fmt: skip
    columns: Columns = {
        name: ([getattr(row, name) for row in found.loads], "", text)
        for name, text in texts.items()
    }
    return [*range(len(found.loads))], columns


def _read(solution: Solution, what: str) -> tuple[list[str], Columns]:
    """The columns that a result file gives without its scene: forces by contact, or rates by
    block."""
    units = solution.units or Units("", "")
    if what == "contacts":
        return list(solution.contact_names), _forces(solution.forces, solution.contacts, units)
    moving = solution.mechanism or {}
    return list(moving), _moving(np.array([*moving.values()]).reshape(-1, 6), units)


def _forces(found: FloatArray | None, number: int, units: Units) -> Columns:
    forces = np.full((number, 6), np.nan) if found is None else found
    columns: Columns = {}
    what = ("shear along t1", "shear along t2", "normal force, compression positive",
            "moment about t1", "moment about t2", "torsion about the normal")  # fmt: skip
    for name, text, values in zip(COMPONENTS, what, forces.T, strict=True):
        unit = f"{units.force}\u00b7{units.length}" if name.startswith("M") else units.force
        columns[name] = values, unit, f"{text}, on block b"
    columns["shear"] = np.hypot(forces[:, 0], forces[:, 1]), units.force, "size of (V1, V2)"
    return columns


SCALED = "for unit power of the live load"


def _moving(rates: FloatArray, units: Units) -> Columns:
    return {
        **_along("u", rates[:, :3], f"{units.length}\u00b7rate", f"velocity along {{}}, {SCALED}"),
        **_along("r", rates[:, 3:], "rad\u00b7rate", f"rotation about {{}}, {SCALED}"),
    }


def _contacts(solution: Solution, scene: Scene) -> tuple[list[str], Columns]:
    contacts, length = scene.contacts, scene.units.length
    ids = np.array([block.id for block in scene.blocks], dtype=object)
    found = contact_forces(scene, solution)
    forces = np.full((len(contacts), 6), np.nan) if found is None else found
    centre, place = pressure_centres(contacts, forces)
    columns: Columns = {
        "a": (ids[contacts.a], "", "block out of which the normal points"),
        "b": (ids[contacts.b], "", "block into which it points, and on which the forces act"),
        "friction": (contacts.friction, "", "Coulomb coefficient"),
        "area": (contacts.area, f"{length}\u00b2", "of the contact"),
    }
    columns |= _forces(forces, len(contacts), scene.units)
    for i, values in enumerate(centre.T, 1):
        text = f"distance of the pressure centre from the contact's centroid, along t{i}"
        columns[f"e{i}"] = values, length, text
    columns |= _along("p", place, length, "{} of the pressure centre")
    for name, used in utilisations(solution, scene).items():
        columns[name] = used, "", _USED.get(name, "share of the strength of that surface in use")
    return list(contacts.names), columns | _rates(solution, scene)


def _along(name: str, values: FloatArray, unit: str, text: str) -> Columns:
    """Three columns for values (n, 3) along x, y and z; {} in the text is the axis."""
    return {
        f"{name}{axis}": (each, unit, text.format(axis))
        for axis, each in zip("xyz", values.T, strict=True)
    }


_USED = {
    "utilisation": "largest share of strength in use, over the surfaces that were solved with; "
    "1 is at the limit; strength that a formulation states itself, as for crushing, is not in it",
    "utilisation_rocking": "distance of pressure centre from centroid, over that of the edge",
    "utilisation_sliding": "shear over friction",
    "utilisation_torsion": "torsion over the torsional strength without shear",
    "utilisation_torsion_shear": "torsion and shear together, on the paper's line (Eq. 24)",
    BENDING: "torsion and shear with the contact's own eccentricity (Eq. 30), as moments say",
}


def _rates(solution: Solution, scene: Scene) -> Columns:
    rate = f"{scene.units.length}\u00b7rate"
    moving = motion(scene, solution)
    what, blank = moving.contacts, 1.0 if moving.moves else np.nan
    states = [ContactKind(k).name.lower() if moving.moves else "" for k in what.kind.tolist()]
    widest, twist = blank * what.widest, blank * what.twist
    return {
        "opening": (widest, rate, f"largest opening rate over the corners, {SCALED}"),
        "slip": (blank * what.slip, rate, f"largest sliding rate over the corners, {SCALED}"),
        "twist": (twist, "rad\u00b7rate", f"relative rotation rate about the normal, {SCALED}"),
        "state": (states, "", "closed, opens, slides or twists in the mechanism"),
    }


def _blocks(solution: Solution, scene: Scene) -> tuple[list[str], Columns]:
    blocks, length = scene.blocks, scene.units.length
    moving = motion(scene, solution)
    blank = 1.0 if moving.moves else np.nan
    weight = np.array([np.nan if b.density is None else b.weight for b in blocks])
    volume = np.array([b.volume for b in blocks])
    centroids = np.array([b.centroid for b in blocks])
    rates, fixed = blank * moving.rates, set(scene.supports)
    columns: Columns = {
        "weight": (weight, scene.units.force, "density times volume"),
        "volume": (volume, f"{length}\u00b3", "of the block"),
        **_along("", centroids, length, "{} of the centroid"),
        **_moving(rates, scene.units),
        "speed": (blank * moving.speed, "", "largest corner speed over the largest of all"),
        "is_support": (np.array([b.id in fixed for b in blocks]), "", "fixed block"),
    }
    return [b.id for b in blocks], columns


def _history(solution: Solution, pandas: Any) -> DataFrame:
    names = [each.name for each in fields(Iterate)]
    table = pandas.DataFrame([asdict(iterate) for iterate in solution.history], columns=names)
    table.index.name = "solve"
    table.attrs = {**_facts(solution), "units": {"seconds": "s"}}
    return table


def _steps(solution: Solution, pandas: Any) -> DataFrame:
    """States from rest to the end; their forces are in :attr:`Solution.steps`."""
    if not solution.steps:
        raise InputError(
            f"there are no steps in {solution!r}: solve(scene, method='incremental') makes some"
        )
    columns: Columns = {
        name: (np.array([getattr(step, name) for step in solution.steps]), "", text)
        for name, text in _OF_A_STEP.items()
    }
    index = range(len(solution.steps))
    return table_from(pandas, index, columns, "step", _facts(solution))


_OF_A_STEP = {
    "displacement": "of the live load since rest, over the elastic one at the load factor reached",
    "load_factor": "multiple of the live load that is carried",
    "sliding": "joints that slide at some point",
    "open": "joints that are open at some point",
    "equilibrium": "largest force that a block lacks, over those that act on it",
    "yield_excess": "largest shear beyond friction, over the total of compressions",
    "against": "power of friction that slips have not gone against, over what they have",
}


def _facts(solution: Solution) -> dict[str, Any]:
    names = ("surface", "load_factor", "lower", "upper", "interaction", "moments")
    band = {} if solution.iteration is None else {"iteration": asdict(solution.iteration)}
    facts = {"scene": solution.scene_name} | {name: getattr(solution, name) for name in names}
    ends = {} if solution.interval is None else {"interval": solution.interval}
    share = {} if solution.dilatancy is None else {"dilatancy": solution.dilatancy.share}
    return {**facts, "status": str(solution.status), **band, **ends, **share}


_TABLES: dict[str, Callable[[Solution, Scene], tuple[list[str], Columns]]] = {
    "contacts": _contacts,
    "blocks": _blocks,
    "history": lambda solution, scene: ([], {}),
    "steps": lambda solution, scene: ([], {}),
}

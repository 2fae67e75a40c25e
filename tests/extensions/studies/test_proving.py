"""Load domains, sweeps and files proved again: unchanged they pass, changed they do not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyarrow import ArrowInvalid

from cvxlimit import GRAVITY, Block, Incremental, Load, Scene, builtin_scene, prove, solve, sweep
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.document import DOMAIN
from cvxlimit.extensions.studies.rows import FIGURES, OF_A_WAY
from cvxlimit.io import write_result, write_scene
from cvxlimit.scene.loads import combined
from cvxlimit.solution import Status
from cvxlimit.studies import LoadDomain, Proof, load_domain, read_domain, write_domain
from cvxlimit.surfaces import Rocking
from helpers import Share
from leaves import unnoticed

X, Y, Z = (Load(acceleration=axis) for axis in np.eye(3))
SLOPE = np.radians(30.0)
TILTED = Load(gravity=(np.sin(SLOPE), 0.0, -np.cos(SLOPE)))


def block(height: float = 1.0, friction: float = 0.3, dead: Load = GRAVITY) -> Scene:
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    tower = Block.box("tower", (0, 0, 0), (1, 1, height), density=20.0)
    return Scene([ground, tower], ["ground"], X, dead, friction=friction, name="block")


def held_block() -> Scene:
    """With a wall at its back, towards which it can be pushed at will."""
    wall, scene = Block.box("wall", (-1, 0, 0), (0, 1, 2.5)), block(2.5, 0.7)
    return Scene([*scene.blocks, wall], ["ground", "wall"], X, friction=0.7)


DOMAINS: dict[str, tuple[Scene, dict[str, Any]]] = {
    "block": (block(), {}),
    "rays": (held_block(), {}),
    "pressed": (block(2.5, 0.7), {"loads": {"x": X, "z": Z}}),
    "idle": (block(2.5, 0.7), {"loads": {"x": X, "y": Y, "third": Load()}}),
    "one point": (block(friction=0.0), {}),
    "flat": (block(friction=0.0), {"loads": {"x": X, "z": Z}}),
    "zero outside": (block(1.0, 0.3, TILTED), {}),
    "zero on the edge": (block(1.0, float(np.tan(SLOPE)), TILTED), {}),
    "nothing": (block(dead=Load(acceleration=(0, 0, 1))), {}),
    "octagon": (block(), {"surface": "octagon"}),
    "parabola": (block(), {"surface": "parabolic"}),
    "mortar": (block().with_cohesion(30.0).with_strength(tensile=10.0), {}),
    "crushing": (block(2.5, 0.7).with_strength(compressive=200.0), {"tolerance": 0.3}),
    "wedged": (builtin_scene("flying-buttress"), {}),
    "wall": (builtin_scene("tuff-wall"), {}),
    "interaction": (builtin_scene("stack"), {"method": "certified", "directions": 4}),
}


def written(case: str, path: Path) -> Scene:
    write_domain(domain(case), path)
    return DOMAINS[case][0]


@cache
def domain(case: str) -> LoadDomain:
    scene, options = DOMAINS[case]
    given = {"tolerance": 0.1, "progress": False, **options}
    return load_domain(scene, given.pop("loads", None), **given)


@pytest.mark.parametrize("case", DOMAINS)
def test_a_domain_is_proved_again(case: str, tmp_path: Path) -> None:
    scene = written(case, tmp_path / "domain.json")
    proof = prove(tmp_path / "domain.json", scene)
    assert proof.is_proved, str(proof)


def moved(document: dict[str, Any]) -> None:
    document["supports"][0]["point"] = [9.0, 9.0]


def usual(document: dict[str, Any]) -> dict[str, Any]:
    """A support with a point, not near zero, forces and a mechanism."""
    for held in document["supports"]:
        far = np.abs(held["point"] or [0.0]).max()
        if 1e-3 < far < 10.0 and held["solution"] and held["solution"]["mechanism"]:
            return held
    raise AssertionError


def support(key: str, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        held = usual(document)
        held[key] = value(held[key]) if callable(value) else value

    return change


def solution(key: str, change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    def changed(document: dict[str, Any]) -> None:
        held = usual(document)["solution"]
        held[key] = change(held[key])

    return changed


def more(rows: list[list[float]]) -> list[list[float]]:
    return [[1.1 * x for x in row] for row in rows]


def turned(rates: dict[str, list[float]]) -> dict[str, list[float]]:
    return {k: [r[0], r[1] + 0.3 * r[0], 1.5 * r[2], *r[3:]] for k, r in rates.items()}


CHANGES: dict[str, Callable[[dict[str, Any]], None]] = {
    "a point at (9, 9)": moved,
    "a point a little out": support("point", lambda p: [1.001 * x for x in p]),
    "a point a little in": support("point", lambda p: [0.999 * x for x in p]),
    "a ray": support("ray", [1.0, 0.0]),
    "an offset": support("offset", lambda x: 0.9 * x),
    "a wider offset": support("offset", lambda x: 1.1 * x),
    "a normal": support("normal", lambda n: [n[0] + 0.1, n[1]]),
    "no solution": support("solution", None),
    "forces": solution("forces", more),
    "a mechanism": solution("mechanism", turned),
    "a load factor": solution("load_factor", lambda x: 1.01 * x),
    "a lower bound": solution("lower", lambda x: 1.01 * x),
    "an upper bound": solution("upper", lambda x: 0.99 * x),
    "units": lambda d: d.update(units=[2.0 * x for x in d["units"]]),
    "a gap": lambda d: d.update(tolerance=1e-6),
    "empty": lambda d: d.update(status="dead load cannot stand"),
    "a load": lambda d: d["loads"][0].__setitem__(1, {"acceleration": [0.5, 0, 0]}),
}


@pytest.mark.parametrize("case", ["block", "rays"])
@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_domain_is_not(case: str, change: str, tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    scene = written(case, path)
    document = json.loads(path.read_text("utf-8"))
    CHANGES[change](document)
    path.write_text(json.dumps(document), "utf-8")
    proof = prove(path, scene)
    assert not proof.is_proved, str(proof)
    assert all(check.found for check in proof.missing)


def test_a_domain_with_interaction_that_was_changed_is_not(tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    scene = written("interaction", path)
    document = json.loads(path.read_text("utf-8"))
    for change in (moved, CHANGES["an offset"], CHANGES["forces"], CHANGES["a mechanism"]):
        other = json.loads(json.dumps(document))
        change(other)
        path.write_text(json.dumps(other), "utf-8")
        assert not prove(path, scene).is_proved


@pytest.mark.parametrize("status", ["live load does no harm", "not certified", "converged"])
def test_a_status_of_a_domain_follows_from_its_gap(status: str) -> None:
    held = replace(domain("block"), status=Status(status))
    assert [c.claim for c in prove(held, block()).missing] == [f"status {status!r}"]


def test_no_domain_is_certified_to_any_gap() -> None:
    document = DOMAIN.to_dict(domain("block"))
    with pytest.raises(InputError, match="tolerance must be between 0 and 1, got 1000000000"):
        DOMAIN.from_dict(document | {"tolerance": 1e9})
    told = str(prove(DOMAIN.from_dict(document | {"tolerance": 0.9}), block()))
    assert "status 'certified' (0.9 asked for)" in told


def test_domains_need_their_scene_and_surfaces(tmp_path: Path) -> None:
    path, surface = tmp_path / "domain.json", [Rocking(), Share(0.5)]
    domain = load_domain(block(), tolerance=0.1, surface=surface, path=path, progress=False)
    assert prove(domain, block(), surface=surface).is_proved
    assert not prove(domain, block(), surface=[Rocking(), Share(0.4)]).is_proved
    with pytest.raises(InputError, match="does not hold its scene 'block'"):
        prove(path)
    with pytest.raises(InputError, match="give them as surface"):
        prove(path, block())
    with pytest.raises(InputError, match="of another scene"):
        prove(path, block(friction=0.4), surface=surface)
    again = block().with_live(Y)  # which does not matter
    assert prove(read_domain(path), again, surface=surface).is_proved


# Sweeps

GRID = {"friction": [0.2, 0.3, -1.0], "tilt": [0.0, 2.0, 40.0], "surface": ["conic", "octagon"]}


def build(friction: float, height: float) -> Scene:
    return block(height, friction)


def swept(folder: Path, **options: Any) -> None:
    sweep(block(2.0), GRID, path=folder, progress=False, **options)


def test_a_sweep_is_proved_again(tmp_path: Path) -> None:
    swept(tmp_path / "s")
    proof = prove(tmp_path / "s")
    assert proof.is_proved, str(proof)
    assert str(proof.checks[0]) == "12 rows with their brackets: proved"
    assert "6 rows more that say why they have no result" in proof.rows[-1]


def test_a_sweep_over_a_function_needs_it(tmp_path: Path) -> None:
    grid = {"friction": [0.2, 0.3], "height": [1.0, 2.0]}
    measure = lambda s: {"moving": len(s.mechanism)}  # noqa: E731
    sweep(build, grid, path=tmp_path / "s", progress=False, measure=measure)
    with pytest.raises(InputError, match="a function built the scenes of this sweep"):
        prove(tmp_path / "s")
    assert prove(tmp_path / "s", build).is_proved
    other = prove(tmp_path / "s", lambda friction, height: block(height, 0.9 * friction))
    assert len(other.missing) == 4
    assert "of another scene" in other.missing[0].found


def in_part(column: str, value: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        part = sorted(folder.glob("part-*.parquet"))[0]
        rows = pd.read_parquet(part)
        rows.loc[0, column] = value(rows.loc[0, column]) if callable(value) else value
        rows.to_parquet(part, index=False)

    return change


def in_both(folder: Path) -> None:
    """By somebody who knows where the numbers are."""
    for column in ("load_factor", "lower", "upper"):
        in_part(column, lambda x: 1.05 * x)(folder)
    proof = sorted(folder.glob("_proof-*.parquet"))[0]
    rows = pd.read_parquet(proof)
    result = json.loads(rows.loc[0, "proof"])
    result |= {key: 1.05 * result[key] for key in ("load_factor", "lower", "upper")}
    rows.loc[0, "proof"] = json.dumps(result)
    rows.to_parquet(proof, index=False)


def no_proofs(folder: Path) -> None:
    for proof in folder.glob("_proof-*.parquet"):
        proof.unlink()


def no_json(folder: Path) -> None:
    proof = sorted(folder.glob("_proof-*.parquet"))[0]
    rows = pd.read_parquet(proof)
    rows.loc[0, "proof"] = "{"
    rows.to_parquet(proof, index=False)


SPOILT: dict[str, Callable[[Path], None]] = {
    "load factor": in_part("load_factor", lambda x: 1.001 * x),
    "lower": in_part("lower", lambda x: 1.001 * x),
    "upper": in_part("upper", lambda x: 0.999 * x),
    "gap": in_part("gap", 0.0),
    "least factor": in_part("least_factor", -5.0),
    "status": in_part("status", "live load does no harm"),
    "note": in_part("note", "carries everything"),
    "error": in_part("error", "no such friction"),
    "variation": in_part("variation", "0" * 24),
    "no row": lambda folder: sorted(folder.glob("part-*.parquet"))[0].write_bytes(
        sorted(folder.glob("part-*.parquet"))[-1].read_bytes()
    ),
    "friction": in_part("friction", 0.25),
    "tilt": in_part("tilt", 1.0),
    "surface": in_part("surface", "octagon"),
    "identity": in_part("identity", "0" * 32),
    "row and result": in_both,
    "no proofs": no_proofs,
    "no result": no_json,
}


@pytest.fixture(scope="module")
def unspoilt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep") / "s"
    sweep(block(2.0), {**GRID, "tilt": [0.0]}, path=folder, progress=False)
    assert prove(folder).is_proved
    return folder


@pytest.mark.parametrize("how", SPOILT)
def test_a_changed_sweep_is_not(how: str, unspoilt: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(unspoilt, tmp_path / "s")
    SPOILT[how](folder)
    proof = prove(folder)
    assert not proof.is_proved, str(proof)
    assert len(proof.missing) >= 1


def test_a_least_factor_is_that_of_its_result(tmp_path: Path) -> None:
    """0.1 of the push holds the block on its slope, 1.1 of it pushes it up."""
    dead = Load(gravity=(0, 0, -1), acceleration=(0.6, 0, 0))
    scene = block(0.5, 0.5, dead).with_live(Load(acceleration=(-1, 0, 0)))
    sweep(scene, {"friction": [0.5]}, path=tmp_path / "s", progress=False)
    assert prove(tmp_path / "s").is_proved
    (part,) = (tmp_path / "s").glob("part-*.parquet")
    rows = pd.read_parquet(part)
    assert rows.least_factor[0] == pytest.approx(0.1)
    for other in (0.15, -5.0, np.nan):
        rows.assign(least_factor=other).to_parquet(part, index=False)
        (missing,) = prove(tmp_path / "s").missing
        assert "least_factor" in missing.claim


def test_rows_of_ways_from_rest_have_columns_of_their_own(tmp_path: Path) -> None:
    """A block that slides at its friction, on true beds and others: stored, proved, falsified."""
    method = Incremental(bedding=0.1, draws=2)
    given = {"friction": [0.2, 0.3]}
    table = sweep(block(0.5, 0.5), given, method=method, path=tmp_path / "s", progress=False)
    for name in ("load_factor", *(name for name in OF_A_WAY if name != "from_rest_to_come")):
        assert table[name].tolist() == pytest.approx([0.2, 0.3], rel=1e-3), name
    assert (table["from_rest_spread_least"] <= table["from_rest_spread_most"]).all()
    assert not {*OF_A_WAY} & {*sweep(block(0.5, 0.5), given, progress=False)}
    assert not prove(tmp_path / "s").missing
    part = sorted((tmp_path / "s").glob("part-*.parquet"))[0]
    rows = pd.read_parquet(part)
    for changed in (rows.assign(from_rest_limit=0.1), rows.drop(columns="from_rest_beds_most")):
        changed.to_parquet(part, index=False)
        claims = [missing.claim for missing in prove(tmp_path / "s").missing]
        assert claims
        assert all("from_rest_" in claim for claim in claims)
    with pytest.raises(InputError, match="'from_rest_limit'"):
        sweep(lambda from_rest_limit: block(0.5, 0.5), {"from_rest_limit": [1.0]}, progress=False)


@pytest.mark.parametrize("column", ["gap", "least_factor", "error", "identity", "status"])
def test_a_part_without_a_column_is_told(column: str, unspoilt: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(unspoilt, tmp_path / "s")
    for part in folder.glob("part-*.parquet"):
        pd.read_parquet(part).drop(columns=column).to_parquet(part, index=False)
    with pytest.raises(InputError, match=f"lacks the column '{column}': delete the part"):
        prove(folder)


def as_document(folder: Path) -> dict[str, Any]:
    def rows(kind: str) -> list[dict[str, Any]]:
        parts = map(pd.read_parquet, sorted(folder.glob(f"{kind}-*.parquet")))
        every = [row for part in parts for row in part.to_dict("records")]
        return [{k: x if x == x else None for k, x in row.items()} for row in every]

    proofs = [row | {"proof": json.loads(row["proof"])} for row in rows("_proof")]
    about = json.loads((folder / "_sweep.json").read_text("utf-8"))
    return {"about": about, "rows": rows("part"), "proofs": proofs}


def as_folder(document: dict[str, Any], folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (folder / "_sweep.json").write_text(json.dumps(document["about"]), "utf-8")
    rows = pd.DataFrame(document["rows"])
    figures = [name for name in FIGURES if name in rows]
    rows[figures] = rows[figures].apply(pd.to_numeric)
    rows.to_parquet(folder / "part-000000-0.parquet", index=False)
    proofs = [row | {"proof": json.dumps(row.get("proof"))} for row in document["proofs"]]
    pd.DataFrame(proofs).to_parquet(folder / "_proof-000000-0.parquet", index=False)
    return folder


@pytest.mark.exhaustive
def test_every_leaf_of_a_sweep_counts(tmp_path: Path) -> None:
    grid = {"friction": [0.2, 0.3, -1.0], "surface": ["conic", "octagon"]}
    sweep(block(2.0), grid, path=tmp_path / "s", progress=False)

    def proof_of(document: dict[str, Any]) -> Proof:
        try:
            folder = as_folder(document, tmp_path / "other")
        except (AttributeError, KeyError, TypeError, ValueError, ArrowInvalid) as error:
            raise InputError("no folder is like that") from error
        return prove(folder)

    assert not unnoticed(as_document(tmp_path / "s"), proof_of, every=7, asked=("tolerance",))


def test_half_a_proof_is_named_with_the_cure(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    sweep(block(2.0), {"friction": [0.2]}, path=folder, progress=False)
    (proof,) = folder.glob("_proof-*.parquet")
    proof.write_bytes(proof.read_bytes()[:100])
    with pytest.raises(InputError, match="this part of a sweep is damaged") as caught:
        prove(folder)
    assert f"delete it and {proof.name.replace('_proof', 'part')}" in str(caught.value)
    proof.unlink()
    (folder / proof.name.replace("_proof", "part")).unlink()
    sweep(block(2.0), {"friction": [0.2]}, path=folder, progress=False)
    assert prove(folder).is_proved


@pytest.mark.parametrize("held", ["no JSON", "[1]", 7], ids=repr)
def test_a_proof_that_is_none_is_told(held: object, unspoilt: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(unspoilt, tmp_path / "s")
    for part in folder.glob("_proof-*.parquet"):
        pd.read_parquet(part).assign(proof=held).to_parquet(part, index=False)
    assert all("bracket" in check.claim for check in prove(folder).missing)
    assert not prove(folder).is_proved


def test_what_holds_nothing_to_prove(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    sweep(block(2.0), {"friction": [-1.0]}, path=folder, progress=False)
    assert not prove(folder).is_proved


# The command line


@pytest.fixture
def files(tmp_path: Path) -> Path:
    write_scene(block(), tmp_path / "scene.json")
    write_result(solve(block()), tmp_path / "result.json")
    write_domain(load_domain(block(), tolerance=0.2, progress=False), tmp_path / "domain.json")
    sweep(block(), {"friction": [0.2, 0.3]}, path=tmp_path / "sweep", progress=False)
    return tmp_path


@pytest.mark.parametrize("name", ["result.json", "domain.json", "sweep"])
def test_the_command_proves(name: str, files: Path, capsys) -> None:
    assert run(["prove", str(files / name), "--scene", str(files / "scene.json")]) == 0
    said = capsys.readouterr()
    assert "proved" in said.out
    assert "NOT" not in said.out
    assert said.err == ""


@pytest.mark.parametrize("name", ["result.json", "domain.json"])
def test_the_command_refuses_what_was_changed(name: str, files: Path, capsys) -> None:
    document = json.loads((files / name).read_text("utf-8"))
    if name == "result.json":
        document["load_factor"] *= 1.01
    else:
        moved(document)
    (files / name).write_text(json.dumps(document), "utf-8")
    assert run(["prove", str(files / name), "--scene", str(files / "scene.json")]) == 4
    said = capsys.readouterr()
    assert "NOT proved" in said.out
    assert said.err.count("\n") == 1
    assert "the first is" in said.err


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["result.json"], "does not hold its scene 'block'"),
        (["result.json", "--scene", "arch"], "of another scene"),
        (["domain.json", "--scene", "arch"], "of another scene"),
        (["sweep", "--scene", "arch"], "of another scene"),
        (["scene.json"], "got format 'cvxlimit-scene'"),
        (["nothing.json"], "there is no such file"),
        ([""], "holds no sweep"),
        (["list.json"], "got format None"),
        (["half.json"], "not valid JSON"),
    ],
)
def test_bad_input_is_named(given: list[str], message: str, files: Path, capsys) -> None:
    (files / "list.json").write_text("[1]", "utf-8")
    (files / "half.json").write_bytes((files / "result.json").read_bytes()[:300])
    path, *others = given
    assert run(["prove", str(files / path), *others]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


def test_a_point_of_the_domain_is_one_of_its_own_solution() -> None:
    """The load of each solution in a domain is that of its point: single solves agree."""
    domain = load_domain(block(), tolerance=0.2, progress=False)
    for s in domain.supports:
        again = solve(block().with_live(combined(list(domain.loads.values()), s.loaded)))
        assert s.solution.lower <= again.upper * (1 + 1e-9)


def test_what_loads_of_a_domain_are_called_is_named() -> None:
    """A name proves nothing: exchanged, the axes are called otherwise, and no point has moved."""
    named = prove(domain("block"), block()).of("not looked at")
    assert "loads" in [check.claim for check in named]


@pytest.mark.exhaustive
@pytest.mark.parametrize("case", ["block", "rays", "nothing", "mortar"])
def test_every_leaf_of_a_domain_counts(case: str) -> None:
    given = json.loads(json.dumps(DOMAIN.to_dict(domain(case))))
    proof_of = lambda d: prove(DOMAIN.from_dict(d), DOMAINS[case][0])  # noqa: E731
    assert not unnoticed(given, proof_of, every=7, asked=("tolerance",))

"""Files of load domains: known by what they are of, named where they are damaged."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cvxlimit import Block, Load, Scene
from cvxlimit.errors import InputError, ModelError
from cvxlimit.readings.named import Paper
from cvxlimit.studies import LoadDomain, load_domain, read_domain
from cvxlimit.surfaces import Rocking, YieldSurface
from helpers import Share


def block(friction: float = 0.3, density: float = 20.0, cohesion: float = 0.0) -> Scene:
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    tower = Block.box("tower", (0, 0, 0), (1, 1, 1), density)
    live = Load(acceleration=(1, 0, 0))
    return Scene([ground, tower], ["ground"], live, friction=friction, cohesion=cohesion)


def own(share: float) -> list[YieldSurface]:
    return [Rocking(), Share(share)]


def domain_of(scene: Scene, loads: Any = None, **options: Any) -> LoadDomain:
    return load_domain(scene, loads, **{"tolerance": 0.1, "progress": False, **options})


def test_a_surface_of_ones_own_that_was_edited(tmp_path: Path) -> None:
    """The file of share 1 never answers for share 0.3; with a file of its own that is right."""
    path = tmp_path / "domain.json"
    first = domain_of(block(0.5), surface=own(1.0), path=path)
    assert first.load_factor((1, 0)).lower == pytest.approx(0.5, rel=1e-5)
    before = path.read_bytes()
    with pytest.raises(InputError, match="another scene, other loads or other options"):
        domain_of(block(0.5), surface=own(0.3), path=path)
    assert path.read_bytes() == before
    path.unlink()
    second = domain_of(block(0.5), surface=own(0.3), path=path)
    assert second.load_factor((1, 0)).upper == pytest.approx(0.15, rel=1e-5)


@pytest.mark.parametrize(
    ("scene", "options"),
    [
        (block(density=30.0), {}),
        (block(cohesion=1.0), {}),
        (block().with_joints(contact_friction={("ground", "tower"): 0.2}), {}),
        (block(), {"surface": "octagon"}),
        (block(), {"loads": [Load(acceleration=(0, 1, 0)), Load(acceleration=(1, 0, 0))]}),
    ],
)  # fmt: skip
def test_all_that_decides_about_the_set_counts(scene, options, tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    domain_of(block(), path=path)
    with pytest.raises(InputError, match="take another file, or delete it"):
        domain_of(scene, path=path, **options)


def test_the_live_load_and_the_tolerance_do_not(tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    first = domain_of(block(), path=path)
    again = block().with_live(Load(acceleration=(0, 1, 0)))
    second = domain_of(again, path=path, tolerance=0.05, ladder=["CLARABEL"])
    assert second.supports[0].direction.tolist() == first.supports[0].direction.tolist()
    assert second.solves > first.solves


def test_what_cannot_be_told_apart_is_refused(tmp_path: Path) -> None:
    reading = Paper()
    reading.lines = (x for x in "abc")  # type: ignore[attr-defined]
    with pytest.raises(ModelError, match="cannot be stored: it rests on a generator"):
        domain_of(block(), method="certified", moments=reading, path=tmp_path / "domain.json")
    assert not (tmp_path / "domain.json").exists()


def forget(document: dict[str, Any]) -> None:
    del document["versions"]


def age(document: dict[str, Any]) -> None:
    document["versions"] = {"cvxlimit": "0.1.0"}


@pytest.mark.parametrize("change", [forget, age])
def test_files_of_other_versions_are_read_but_not_continued(change, tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    first = domain_of(block(), path=path)
    document = json.loads(path.read_text("utf-8"))
    change(document)
    path.write_text(json.dumps(document), "utf-8")
    assert read_domain(path).gap == first.gap
    with pytest.raises(InputError, match=r"version.* of cvxlimit, this is .*: take another file"):
        domain_of(block(), path=path)


def widened(name: str) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        document["supports"][1][name] = [0.1, 0.2, 0.3]

    return change


DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    **{
        f"three numbers of {name}": (widened(name), f"{name} of entry 1 of supports must be 2 fin")
        for name in ("direction", "point", "ray", "normal", "loaded")
    },
    "units": (lambda d: d.update(units=[1.0]), "units must be 2 finite numbers"),
    "units below zero": (lambda d: d.update(units=[1.0, -1.0]), "units must be above zero"),
    "no number": (lambda d: d["supports"][0].update(point=["nan", 1.0]), "point of entry 0 of"),
    "no offset": (lambda d: d["supports"][0].update(offset="nan"), "offset of entry 0 of supports"),
    "one load": (lambda d: d.update(loads=d["loads"][:1]), "must be two or three"),
    "a load twice": (lambda d: d.update(loads=d["loads"][:1] * 2), "must be two or three"),
    "a load without a name": (lambda d: d["loads"][0].pop(), "must be a name and a load"),
    "forces": (lambda d: d["supports"][0]["solution"]["forces"].pop(), "forces must be 1 rows"),
}


@pytest.mark.parametrize("what", DAMAGES)
def test_what_is_damaged_is_named(what: str, tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    domain_of(block(), path=path)
    document = json.loads(path.read_text("utf-8"))
    change, message = DAMAGES[what]
    change(document)
    path.write_text(json.dumps(document), "utf-8")
    with pytest.raises(InputError, match=message) as caught:
        read_domain(path)
    assert str(path) in str(caught.value)
    with pytest.raises(InputError, match=message):
        domain_of(block(), path=path)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_half_a_file_is_named(share: float, tmp_path: Path) -> None:
    path = tmp_path / "domain.json"
    domain_of(block(), path=path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match="not valid JSON"):
        domain_of(block(), path=path)


def test_progress_says_unbounded_where_too_little_is_known() -> None:
    """Without friction there is one point, and no way to anything beside it."""
    seen = set()
    for scene in (block(), block(0.0)):
        told = list[str]()
        found = domain_of(scene, progress=told.append, most_solves=6)
        gaps = [line.rpartition("gap ")[2] for line in (*told, found.summary) if "gap " in line]
        seen |= {gap.split(",")[0] for gap in gaps}
    assert "unbounded" in seen
    assert all(0.0 <= float(gap.removesuffix(" %")) <= 100.0 for gap in seen - {"unbounded"})

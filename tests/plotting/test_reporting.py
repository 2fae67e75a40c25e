"""The page to print and sign: what it says, that it stands alone, that names are no markup."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import browser
from cvxlimit import (
    Block,
    Incremental,
    Load,
    Scene,
    Solution,
    Tie,
    Vehicle,
    builtin_scene,
    code_check,
    envelope,
    passive,
    pushover,
    settlement,
    solve,
)
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.io import read_result, scene_digest, write_result
from cvxlimit.masonry import Arch, Opening, bridge, facade
from cvxlimit.plotting import reporting
from cvxlimit.plotting.stated import BLANK

HOSTILE = "<script>alert(1)</script>&\"'</title>\u202e"


class Read(HTMLParser):
    """Tags, addresses and words of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.words = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_data(self, data: str) -> None:
        self.words += " " + data.strip()


def tower(name: str = "tower", **changes: object) -> Scene:
    blocks = [
        Block.box("ground", (-2, -2, -1), (3, 3, 0)),
        Block.box(name, (0, 0, 0), (1, 1, 4), 20),
    ]
    return Scene(blocks, ["ground"], Load(acceleration=(1, 0, 0)), name=name, **changes)  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def unless_asked_without_pictures(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They take a second; what is said does not depend on them."""
    if "pictures" not in request.node.name and "sheets" not in request.node.name:
        monkeypatch.setattr(reporting, "MOST_BLOCKS", 0)


@pytest.fixture(scope="module")
def dam() -> Solution:
    return solve(builtin_scene("dam"))


def test_it_says_what_one_has_to_defend(dam: Solution) -> None:
    page = Read(dam.report()).words
    for said in (
        "1.0572", "between 1.057203 and 1.057204", "both bounds are proved", "certified",
        "moving joints slides: without dilatancy it may fall at less",
        "5, weight 1207.5 kN", "1: ground", "9 x 1 x 10 m", "23 kN/m³",
        "joint tolerance of one hundredth of the thinner block's mean thickness",
        "own weight along (0, 0, -1): (0, 0, -1207.5) kN through",
        "growing by 9.81 kN/m³: (490.5, 0, 0) kN through",
        "Joints bear no tension", "Stone does not crush", "with dilatancy",
        "1 of 5: ground-c1", scene_digest(dam.scene), "cvxlimit 0.2.0", "clarabel",
        "Archive of Applied Mechanics", "signature",
    ):  # fmt: skip
        assert said.lower() in page.lower(), said


def test_it_stands_alone_and_has_two_pictures(dam: Solution) -> None:
    read = Read(dam.report())
    assert len(read.addresses) == 2
    for address in read.addresses:
        kind, data = address.split(",")
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data).startswith(b"\x89PNG")
    assert not {"script", "link", "iframe"} & {*read.tags}


def test_names_are_shown_and_never_markup() -> None:
    solution = solve(tower(HOSTILE))
    page = solution.report(check=HOSTILE, path={HOSTILE: HOSTILE}, sensitivity=HOSTILE)
    read = Read(page)
    assert not {"script", "b"} & {*read.tags}
    assert read.words.count("<script>alert(1)</script>") >= 5
    assert page.count("</title>") == 1
    assert "\u202e" not in page  # would turn the rest of its line round


def test_what_is_not_stated_is_a_line_to_fill_in(dam: Solution) -> None:
    """Head and sources: blank, or what notes say; what has no place of its own stands besides."""
    page = Read(dam.report()).words
    for name in ("object", "author", "place and date", "source"):
        assert f"{name}: {BLANK}" in page
    stated = {"object": f"Dam {HOSTILE}", "friction": "slid in the laboratory", "K": "1.5"}
    page = Read(dam.report(notes=stated)).words
    for said in (f"object: Dam {HOSTILE[:20]}", "source: slid in the laboratory", "Stated besides"):
        assert said in page
    with pytest.raises(InputError, match="notes must be a mapping"):
        dam.report(notes="by hand")  # type: ignore[arg-type]


def test_a_settlement_has_its_page(tmp_path: Path) -> None:
    """From the command line, too, and from a file; the live load has no part in it."""
    asked = ["settle", "arch", "--support", "right-abutment", "--direction", "1,0,0"]
    page, result = tmp_path / "page.html", tmp_path / "result.json"
    assert run([*asked, "--report", str(page), "--json", str(result)]) == 0
    read = Read(page.read_text("utf-8")).words
    assert "least reaction of right-abutment" in read
    assert "live load" not in read
    assert read_result(result).of(builtin_scene("arch")).scene.supports


def test_strengths_exceptions_ties_and_tolerance_have_units() -> None:
    scene = tower(
        joint_tolerance=0.002, compressive_strength=5000.0,
        contact_cohesion={("ground", "tower"): 3.0},
        ties=(Tie("tower", "ground", (1, 0.5, 3), (2.5, 0.5, 0), 7.5),),
    )  # fmt: skip
    page = Read(solve(scene).report()).words
    for said in (
        "0.002 m", "5000 kN/m²", "0; 3 at 1: ground - tower",
        "anchored in tower at (1, 0.5, 3) and ground at (2.5, 0.5, 0) m, yields at 7.5 kN",
    ):  # fmt: skip
        assert said in page, said
    assert "Stone does not crush" not in page


def test_sections_that_are_given(dam: Solution) -> None:
    plain = Read(dam.report()).words
    assert "Code check" not in plain
    assert "Path" not in plain

    class Check:
        rows = (("d0", 0.25, "m", "where the path ends"),)

    words = Read(
        dam.report(check=Check(), path="falls at 0.3 m", sensitivity={"friction": 1.25})
    ).words
    for said in ("Code check", "d0", "0.25", "where the path ends", "falls at 0.3 m", "1.25"):
        assert said in words, said
    frame = dam.to_dataframe("blocks")
    assert "c5" in Read(dam.report(sensitivity=frame)).words


def test_a_path_and_its_check() -> None:
    """The block turns over its toe at 0.4, and has come down where its centroid is above it."""
    wall = builtin_scene("single-block")
    path = pushover(wall)
    words = Read(solve(wall).report(path=path, check=code_check(path))).words
    assert "0.4 with friction at points" in words
    assert "the path of this model: joints rock and do not slide" in words
    assert path.reason in words
    for said in ("Circolare 7/2019", "to be compared with the code in force", "are spectral"):
        assert said in words
    for name, value, unit, _ in code_check(path).rows:
        assert f"{name} {value:.6g} {unit}".rstrip() in words, name


@pytest.mark.exhaustive
def test_a_path_that_slides_says_so_first() -> None:
    path = pushover(builtin_scene("single-block").with_friction(0.2))
    words = Read(path.initial.of(path.scene).report(path=path)).words
    slides = words.index("an upper limit: joints slide on the way")
    assert slides < words.index("0.2 with friction at points")


def test_friction_without_dilatancy_is_beside_it(dam: Solution) -> None:
    without = solve(builtin_scene("dam"), method="zero-dilatancy")
    words = Read(dam.report(without_dilatancy=without)).words
    first = words.index("load factor without dilatancy")  # it is what is to be reported
    assert first < words.index("with dilatancy 1.0572")
    assert "the least load factor if sliding opens no joint" in words
    assert "may fall at less" not in words  # it is proved that it does not
    own = Read(without.report()).words
    assert "without dilatancy, for which there is no single answer" in own


def test_from_rest_has_assumptions_of_its_own(dam: Solution) -> None:
    """The dam does not slide: it ends from rest where it is proved to fall."""
    found = solve(builtin_scene("dam"), method="incremental")
    assert found.load_factor == pytest.approx(dam.load_factor, rel=1e-5)
    words = Read(found.report()).words
    for said in ("reached from rest", "Joints are elastic until", "from rest, not a bound",
                 "The dead load acts first", "at most 1.0573", "ratio 0.1, ratio 1, half the step",
                 f"end {found.from_rest.end}"):  # fmt: skip
        assert said in " ".join(words.split())
    assert "no single answer" not in words


@pytest.mark.exhaustive
def test_from_rest_has_pictures_of_its_curve_and_of_draws() -> None:
    scene = tower()
    for method, number in (
        ("convex", 2),
        (Incremental(), 4),
        (Incremental(bedding=1.0, draws=2), 5),
    ):
        assert len(Read(solve(scene, method=method).report()).addresses) == number


def test_what_loads_add_up_to_and_blocks_that_move_alike(dam: Solution) -> None:
    """Water of 10 m: 490.5 kN at a third of its height, uplift 441.45 kN at a third of 9 m."""
    words = Read(dam.report()).words
    assert "of 0 to 98.1 kN/m²" in words
    x, _, z = reporting_point(words)
    # moments about the heel: 490.5 * 10 / 3 turns one way, 441.45 * 3 the other
    assert 490.5 * z - 441.45 * x == pytest.approx(490.5 * 10 / 3 - 441.45 * 3, rel=1e-3)
    assert "body of 5 blocks" in words


def reporting_point(words: str) -> list[float]:
    sought = r"live load, all of it +\(490\.5, 0, 441\.45\) kN through \(([^)]+)\) m"
    (found,) = re.findall(sought, words)
    return [float(x) for x in found.split(",")]


VECTOR = r"\(([^()]+)\)"


def powers(words: str) -> dict[str, float]:
    """Powers of everything that acts on the bodies of a page, from what the page prints alone."""
    found: dict[str, float] = {}
    for body in re.findall(r"body of \d+ blocks? (.*?)(?= body of|more bodies| balance of)", words):
        how, _, loads = body.partition("; on it ")
        shift, turn, axis = np.zeros(3), np.zeros(3), np.zeros(3)
        for kind, value in re.findall(
            rf"(moves by|along it by|turns by|axis through) {VECTOR}", how
        ):
            given = np.array([float(x) for x in value.split(",")])
            shift, turn, axis = (
                given if kind in named else old
                for named, old in (
                    (("moves by", "along it by"), shift), ("turns by", turn), ("axis through", axis)
                )
            )  # fmt: skip
        for what, force, point in re.findall(rf"([a-z ]+) {VECTOR} kN through {VECTOR} m", loads):
            pushed, at = (np.array([float(x) for x in part.split(",")]) for part in (force, point))
            power = float(pushed @ (shift + np.cross(turn, at - axis)))
            found[what.strip()] = found.get(what.strip(), 0.0) + power
    return found


def held_wall() -> Solution:
    """Soil before the toe resists, a tie holds the top."""
    tie = Tie("c7", "ground", (0.3, 0.5, 2.0), (-0.9, 0.5, 2.0), 2.0)
    wall = builtin_scene("retaining-wall")
    soil = passive(wall, 0.4, 18.0, 1.5, blocks=["c1"])
    return solve(replace(wall, ties=(tie,), reactions=soil))


def crossed(count: int = 2) -> tuple[Solution, Any]:
    """A bridge at the worst of its positions, soil at its haunches."""
    bare = bridge(Arch(3.0, 0.75, voussoirs=16), thickness=0.2, width=2.0, cover=0.2)
    scene = replace(bare, reactions=passive(bare, 1.15, 20.0, 1.5))
    lorry = Vehicle([(0.0, 10.0), (1.2, 20.0)])
    found = envelope(scene, lorry, np.linspace(0.5, 1.0, count), 1.15)
    assert found.worst.solution
    return found.worst.solution, found


def tied_front() -> Solution:
    """Two stones at the top are held by ties, and stay behind where the front falls."""
    front = facade(3.6, 12, [Opening(1.2, 0.9, sill=0, courses=8)], density=18.0, friction=0.6)
    (low,) = (block.centroid for block in front.blocks if block.id == "f12.1")
    tie = Tie("f12.1", "ground", tuple(low), (low[0], 4.0, low[2]), 0.05)
    return solve(replace(front, ties=(tie,), live=Load(acceleration=(0, -1, 0))))


@pytest.mark.parametrize("kind", [held_wall, tied_front, lambda: crossed()[0]])
def test_the_load_factor_is_found_again_by_hand(
    kind: Callable[[], Solution],
) -> None:
    """On the mechanism the live load has power 1, and what resists the load factor's: upper bound.

    Numbers are printed to six digits, of terms up to ten times their sum.
    """
    solution = kind()
    found = powers(" ".join(Read(solution.report()).words.split()))
    assert found.pop("live load") == pytest.approx(1.0, abs=2e-5)
    assert -sum(found.values()) == pytest.approx(solution.upper, rel=2e-5)
    assert found.keys() & {"ties", "reactions"}


def test_the_worst_place_of_a_vehicle_says_what_its_axles_bring() -> None:
    solution, found = crossed(1)
    words = " ".join(Read(solution.report(envelope=found)).words.split())
    brought = re.findall(r"kN at [-\d.]+ m, ([\d.]+) kN of it on the bridge", words)
    lost = float(*re.findall(r"([\d.e-]+) kN on abutments and ground", words))
    assert sum(map(float, brought)) + lost == pytest.approx(30.0, rel=1e-5)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"path": 3}, "path must be a Path, a text, a mapping or a table, got 3"),
        ({"sensitivity": 1}, "sensitivity must be a Sensitivity"),
        ({"check": 0.5}, "check must be a CodeCheck"),
        ({"without_dilatancy": 0.3}, "without_dilatancy must be a Solution, got 0.3"),
        ({"path": "self"}, "path must be a Path"),
        ({"without_dilatancy": "self"}, "must be of a method without dilatancy"),
        ({"sensitivity": "other"}, r"another scene \('single-block'\) than the result of 'dam'"),
        ({"path": "followed"}, r"path is of another scene \('single-block'\)"),
        ({"check": "checked"}, "check is of scene 'single-block'"),
    ],
)  # fmt: skip
def test_sections_of_something_else_are_refused(dam: Solution, given: dict, said: str) -> None:
    block = builtin_scene("single-block")
    made = {
        "self": lambda: dam,
        "other": lambda: solve(block).sensitivity(),
        "followed": lambda: pushover(block),
        "checked": lambda: code_check(pushover(block)),
    }
    ((name, value),) = given.items()
    with pytest.raises(InputError, match=said):
        dam.report(**{name: made[value]() if isinstance(value, str) else value})


def test_a_reaction_and_what_has_no_answer() -> None:
    piers = [Block.box(f"p{i}", (x, 0, -1), (x + 0.2, 1, 0)) for i, x in enumerate((0, 0.8))]
    beam = Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)
    scene = Scene([*piers, beam], ["p0", "p1"], Load(acceleration=(1, 0, 0)))
    words = Read(settlement(scene, "p1", (0, 0, -1)).solution.report()).words
    assert re.search(r"least reaction of p1 +0\.750+ kN", words)
    assert re.search(r"support p1 +moves by \(0, 0, -1\)", words)
    assert "live load" not in words
    leaning = [*piers[:1], Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)]
    falls = solve(Scene(leaning, ["p0"], Load(acceleration=(1, 0, 0))))
    assert "no load factor: dead load cannot stand" in Read(falls.report()).words


def test_it_needs_the_scene(dam: Solution, tmp_path: Path) -> None:
    write_result(dam, tmp_path / "dam.json")
    read = read_result(tmp_path / "dam.json")
    with pytest.raises(InputError, match=r"has no scene, .* solution.of\(scene\)"):
        read.report()
    again = read.of(dam.scene).report(tmp_path / "dam.html")
    assert again == tmp_path / "dam.html"
    assert "1.0572" in again.read_text("utf-8")


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "stack.html"
    assert run(["solve", "stack", "--report", str(file)]) == 0
    assert f"written      {file}" in capsys.readouterr().out
    assert "signature" in file.read_text("utf-8")
    assert run(["solve", "dam", "--report", str(file), "--no-dilatancy"]) == 0
    said = capsys.readouterr().out
    assert "if sliding opens no joint" in said
    assert "--method zero-dilatancy" not in said  # it has just run
    page = file.read_text("utf-8")
    assert "load factor without dilatancy" in page
    assert "without dilatancy in the number that leads" in page
    assert run(["pushover", "single-block", "--code-check", "1.35", "--report", str(file)]) == 0
    assert "Circolare 7/2019" in file.read_text("utf-8")
    file.unlink()
    capsys.readouterr()
    for wrong in (["--no-dilatancy"], ["--method", "zero-dilatancy", "--sensitivity"]):
        asked = ["--report", str(file)] * ("--method" in wrong)
        assert run(["solve", "stack", *asked, *wrong]) == 2
        assert "goes with" in capsys.readouterr().err
    assert not file.exists()
    assert run(["solve", "stack", "--report", str(tmp_path / "stack.pdf")]) == 2
    assert "--report" in (said := capsys.readouterr().err)
    assert "the name must end in .html" in said


@pytest.mark.browser
@pytest.mark.parametrize("kind", ["facade", "long", "bridge", "day", "from rest"])
def test_it_prints_on_two_sheets(kind: str, tmp_path: Path) -> None:
    if kind == "facade":
        solution = solve(builtin_scene("facade"))
        page = solution.report()
    elif kind == "bridge":
        solution, found = crossed(8)
        page = solution.report(envelope=found)
    elif kind == "from rest":
        page = solve(builtin_scene("tuff-wall"), method="incremental").report()
    elif kind == "day":  # all that a day's work has
        scene = builtin_scene("stack")
        path = pushover(scene)
        check = code_check(path, confidence_factor=1.35)
        page = solve(scene, method="incremental").report(path=path, check=check)
    else:
        name = "a wall with a name that goes on " * 30
        solution = solve(tower(name))
        rows = {f"{name} {i}": 1.0 for i in range(8)}
        page = solution.report(check=rows, path="falls", sensitivity="friction: 0.9")
    file = page.save(tmp_path / "report.html")
    with browser() as tab:
        tab.driver.get(file.as_uri())
        printed = base64.b64decode(tab.driver.print_page())
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) <= 2

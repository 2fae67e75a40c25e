"""The page to print and sign: what it says, that it stands alone, that names are no markup."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from browser import browser
from cvxlimit import (
    Block,
    Load,
    Scene,
    Solution,
    Tie,
    builtin_scene,
    code_check,
    pushover,
    settlement,
    solve,
)
from cvxlimit.cli.main import run
from cvxlimit.errors import InputError
from cvxlimit.io import read_result, scene_digest, write_result
from cvxlimit.plotting import reporting

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
        "own weight along (0, 0, -1); (0, 0, -1207.5) kN in all",
        "growing by up to 10.9 kN/m³; (490.5, 0, 441.45) kN in all",
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


def test_strengths_exceptions_ties_and_tolerance_have_units() -> None:
    scene = tower(
        joint_tolerance=0.002, compressive_strength=5000.0,
        contact_cohesion={("ground", "tower"): 3.0},
        ties=(Tie("tower", "ground", (1, 0.5, 3), (2.5, 0.5, 0), 7.5),),
    )  # fmt: skip
    page = Read(solve(scene).report()).words
    for said in (
        "0.002 m", "5000 kN/m²", "0; 3 at 1: ground - tower", "tower - ground, yields at 7.5 kN",
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


def test_what_loads_add_up_to_and_blocks_that_move_alike(dam: Solution) -> None:
    """Water of 10 m: 490.5 kN at a third of its height, uplift 441.45 kN at a third of 9 m."""
    words = Read(dam.report()).words
    assert "of 0 to 98.1 kN/m²" in words
    assert re.search(r"along a line through \([^)]+\) m", words)
    x, _, z = reporting_point(words)
    # moments about the heel: 490.5 * 10 / 3 turns one way, 441.45 * 3 the other
    assert 490.5 * z - 441.45 * x == pytest.approx(490.5 * 10 / 3 - 441.45 * 3, rel=1e-3)
    assert "moving blocks all 5 move alike" in words


def reporting_point(words: str) -> list[float]:
    (found,) = re.findall(r"441\.45\) kN in all, along a line through \(([^)]+)\) m", words)
    return [float(x) for x in found.split(",")]


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
@pytest.mark.parametrize("kind", ["facade", "long"])
def test_it_prints_on_two_sheets(kind: str, tmp_path: Path) -> None:
    if kind == "facade":
        solution = solve(builtin_scene("facade"))
        page = solution.report()
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

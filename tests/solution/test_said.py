"""What a solution says in three lines and in one sentence, kind by kind of answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from cvxlimit import Block, Load, Scene, Solution, builtin_scene, settlement, solve
from cvxlimit.cli.main import run
from cvxlimit.cli.report import details, summary
from cvxlimit.cli.shell import show
from cvxlimit.extensions.dilatancy.zero_dilatancy import ZeroDilatancy
from cvxlimit.io import write_scene
from cvxlimit.masonry.walls import stack
from cvxlimit.methods.convex import Convex
from cvxlimit.methods.driver import Method, Run, Steps
from cvxlimit.methods.fixed_point import FixedPoint
from cvxlimit.plotting import reporting, title
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solution.kinematics import Dilatancy
from cvxlimit.solution.records import Search, Status
from cvxlimit.solution.said import ends, said
from cvxlimit.surfaces import Rocking, TorsionShear

WIDE = 104
"""Characters of a line that a terminal shows at once, and a reader takes in."""


def slab(live: tuple[float, float, float] = (1, 0, 0), lean: float = 0.0) -> Scene:
    """A flat block on the ground, friction 0.5, pulled along x by ``lean`` times its weight."""
    blocks = [
        Block.box("ground", (-9, -9, -1), (9, 9, 0)),
        Block.box("slab", (0, 0, 0), (1, 1, 0.2), density=20.0),
    ]
    dead = Load(gravity=(0, 0, -1), acceleration=(lean, 0, 0))
    return Scene(blocks, ["ground"], Load(acceleration=live), dead, friction=0.5, name="slab")


@dataclass(frozen=True)
class Held(Method):
    """Somebody's own method for one solution without dilatancy."""

    name = "held"
    answers = "one solution without dilatancy"
    axis = "flow"

    def steps(self, run: Run) -> Steps:
        yield from Convex().steps(run)
        run.best = replace(run.best, bracket=Bracket())
        return Status.CONVERGED


FEW = ZeroDilatancy(searches=1, budget=60)


def answers() -> dict[str, Solution]:
    """One of every kind."""
    members = solve(builtin_scene("ferris-tin-loi-1"), method=FEW)
    half = replace(members.members[0], load_factor=-0.05)
    below = replace(members, load_factor=-0.05, members=(half, *members.members))
    unsettled = solve(builtin_scene("arch"), "octagon", method=FixedPoint(max_iterations=4))
    piers = [Block.box(f"p{i}", (x, 0, -1), (x + 0.2, 1, 0)) for i, x in enumerate((0, 0.8))]
    beam = Block.box("beam", (0, 0, 0), (1, 1, 0.2), density=10.0)
    on_piers = Scene([*piers, beam], ["p0", "p1"], Load(acceleration=(1, 0, 0)))
    rocks = solve(stack(1, (0.4, 1.0, 1.0)))
    return {
        "rocks": rocks,
        "slides": solve(slab()),
        "interval": solve(slab((-1, 0, 0), 0.6)),
        "from a on": solve(slab((0, 0, -1), 0.6)),
        "falls": solve(slab((1, 0, 0), 0.6)),
        "no harm": solve(slab((0, 0, -1))),
        "lowest member": members,
        "zero between": below,
        "least": solve(slab(), method=FEW),
        "no member": replace(members, load_factor=None, members=(), status=Status.NOT_CONVERGED),
        "unsettled": unsettled,
        "settled": solve(stack(1, (0.4, 1.0, 1.0)), method="fixed-point"),
        "bending": solve(builtin_scene("arch"), method="certified"),
        "one solution": solve(slab(), method=Held()),
        "reaction": settlement(on_piers, "p1", (0, 0, -1)).solution,
        "wide": replace(rocks, bracket=Bracket(0.25, 0.5), status=Status.NOT_CERTIFIED),
        "stopped": replace(members, status=Status.INTERRUPTED),
        "no solver": replace(rocks, bracket=Bracket(), status=Status.SOLVER_FAILED),
        "one bound": replace(rocks, bracket=Bracket(0.25), status=Status.NOT_CERTIFIED),
    }


@pytest.fixture(scope="module")
def kinds() -> dict[str, Solution]:
    return answers()


SENTENCES = {
    "rocks": "the load factor, proved to lie between 0.3999999 and 0.4000001 for this model",
    "slides": "1 of 1 moving joints slides: without dilatancy it may fall at less",
    "interval": "stands with 0.1 to 1.1 times the live load, and neither with less nor with more",
    "from a on": "it stands with any multiple of the live load from 0.2 on, not with less",
    "falls": "no load factor: dead load cannot stand",
    "no harm": "no load factor: live load does no harm",
    "lowest member": "not proved to be the least; of all such solutions none is above 0.",
    "zero between": "whether it stands depends on the state of forces",
    "least": "the least load factor if sliding opens no joint; of all such solutions none is below "
    "0.",
    "no member": "no solution without dilatancy was found, which does not say that there is none",
    "unsettled": "no load factor: not converged; last 4 iterates ",
    "settled": "where the iteration of the paper settled; it bounds nothing; last 6 iterates 0.4",
    "bending": "the load factor with bending (independent moments), proved to lie between 0.1",
    "one solution": "one solution if sliding opens no joint; there may be lower ones",
    "reaction": "the least reaction of p1, proved to lie between ",
    "wide": "between 0.25 and 0.5 for this model: not certified, as the bracket is wider than was",
    "stopped": "lowest load factor found at which it can fall if sliding opens no joint; not",
    "no solver": "no load factor: solver failed",
    "one bound": "the load factor is at least 0.25 for this model, and the other bound is not",
}


@pytest.mark.parametrize("kind", SENTENCES)
def test_the_headline_says_what_the_number_is_and_is_not(
    kind: str, kinds: dict[str, Solution]
) -> None:
    told, words = said(kinds[kind]), SENTENCES[kind]
    assert words in told.headline


def test_the_report_of_a_lowest_member_begins_with_what_it_is(
    kinds: dict[str, Solution], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reporting, "MOST_BLOCKS", 0)  # without pictures, which take a second
    page = kinds["lowest member"].report()
    assert page.index(SENTENCES["lowest member"]) < page.index("Structure")
    assert "relative width inf" not in page
    assert "bounds nothing" not in page


@pytest.mark.parametrize("kind", SENTENCES)
def test_rows_are_short(
    kind: str, kinds: dict[str, Solution], capsys: pytest.CaptureFixture[str]
) -> None:
    show(summary(kinds[kind], []))
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= WIDE
    assert len(lines) <= 5  # one more where 0 lies between the solutions
    assert all(line == line.rstrip() for line in lines)


def test_a_number_that_nothing_bounds_is_not_shown_as_the_answer(
    kinds: dict[str, Solution],
) -> None:
    unsettled = kinds["unsettled"]
    assert unsettled.load_factor is None
    assert unsettled.history[-1].load_factor is not None
    assert said(unsettled).value == "none"
    assert unsettled.dilatancy is None  # nothing is said of what is no answer
    assert "5 times in a row" in dict(said(unsettled).rows)["paper"]
    assert said(kinds["bending"]).value.startswith("between ")
    assert said(kinds["zero between"]).rows[0][0] == "dead load"
    below = replace(kinds["zero between"], members=kinds["zero between"].members[:1])
    assert "0 lies above all solutions found" in said(below).headline


def test_what_searches_say_of_each_other_has_a_row(kinds: dict[str, Solution]) -> None:
    note = (
        "34 solutions found, 1.7 to 1.8; lowest of 4 searches, ended at 1.7284; none is known below"
    )
    rows = dict(said(replace(kinds["lowest member"], note=note)).rows)
    assert rows["searches"] == "lowest of 4 searches, ended at 1.7284"


def test_no_row_names_a_number_that_is_not_to_be_reported_yet(kinds: dict[str, Solution]) -> None:
    """The lowest member is one where searches ended alike, and friction lies along the slip."""
    lowest = kinds["lowest member"]
    assert said(lowest).report.startswith(said(lowest).value)
    factor = lowest.load_factor or 0.0
    apart = tuple(Search(k, (1.0 + 0.002 * k) * factor, 300, 90) for k in range(2))
    none = (apart[0], Search(1, None, 300, 0))
    turned = (replace(lowest.members[0], angle=2e-3), *lowest.members[1:])
    for changes in ({"searches": apart}, {"searches": none}, {"members": turned}):
        told = said(replace(lowest, **changes))
        assert told.report.startswith("nothing yet")
        assert not any(mark.isdigit() for mark in told.report)


def test_the_row_that_warns_has_no_load_factor() -> None:
    """Counts of joints are none."""
    names = tuple(f"a-{i}" for i in range(9))
    row = Dilatancy(1.2, names, 10).row
    assert row == "9 of 10 moving joints slide: without dilatancy it may fall at less"
    assert "." not in row
    assert Dilatancy(np.inf, names, 10).row == ""
    assert Dilatancy(0.001, names, 10).row == ""
    sentence = str(Dilatancy(1.2, names, 10))
    assert sentence.startswith(row)
    assert sentence.endswith("a-4 and 4 more")  # what may be cut stands last


@pytest.mark.parametrize("width", [1e-9, 1e-5, 1e-3, 0.05, 0.7])
def test_printed_ends_hold_the_bracket_and_say_no_more_than_it_does(width: float) -> None:
    """Rounding outwards widens it by a fifth at most, or in the last of seven digits."""
    for lower in 0.123456789 * 1.7 ** np.arange(20):
        bracket = Bracket(lower * (1.0 - width), lower)
        low, high = map(float, ends(bracket))
        assert low <= bracket.lower
        assert bracket.upper <= high
        assert high - low <= 1.2 * width * lower + 2.1e-6 * lower


def test_the_command_line_says_three_rows_and_the_rest_when_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_scene(slab(), tmp_path / "slab.json")
    asked = ["solve", str(tmp_path / "slab.json")]
    assert run(asked) == 0
    brief = capsys.readouterr().out
    assert [line.split("  ")[0] for line in brief.splitlines()] == [
        "load factor", "sliding", "report",
    ]  # fmt: skip
    assert "--method incremental (" in brief
    assert "ground-slab" not in brief
    assert run([*asked, "-v"]) == 0
    out = capsys.readouterr().out
    assert out.startswith(brief)
    assert "those that slide: ground-slab" in out
    assert run(["solve", "tuff-wall", "--method", "fixed-point"]) == 4
    out, err = capsys.readouterr()
    assert "load factor  none   not converged; last 40 iterates " in out
    assert "sliding" not in out
    assert len(out.splitlines()) <= 4  # iterates are for those who ask
    assert err.startswith("cvxlimit: not converged: last 40 iterates ")
    assert " ... " not in err


class OwnSurface(TorsionShear):
    """Somebody's own, which is the paper's."""

    name = "somebody's torsion"


@dataclass(frozen=True)
class OwnLoop(Method):
    """Somebody's own loop without bounds, which answers the plain question."""

    name = "own-loop"

    def steps(self, run: Run) -> Steps:
        yield from Convex().steps(run)
        run.best = replace(run.best, bracket=Bracket())
        return Status.CONVERGED


SURFACES: dict[str, tuple[Any, str]] = {
    "parabolic": ({"surface": "parabolic"}, "parabolic"),
    "exact": ({"method": "exact"}, "exact"),
    "octagon": ({"surface": "octagon"}, "octagon"),
    "12-gon": ({"surface": "12-gon-inscribed"}, "12-gon-inscribed"),
    "own": ({"surface": [Rocking(), OwnSurface()]}, "somebody's torsion"),
    "own loop": ({"method": OwnLoop()}, "conic"),
    "own both": ({"surface": [Rocking(), OwnSurface()], "method": OwnLoop()}, "somebody's torsion"),
}


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.exhaustive_cases("12-gon", "octagon", "parabolic", "own loop", "own both")
def test_surfaces_are_called_by_their_names_in_every_summary(name: str) -> None:
    """And nobody's are interaction, or have moments, or a width that is not known."""
    given, called = SURFACES[name]
    solution = solve(builtin_scene("single-block"), **given)
    console = Console(width=200)
    with console.capture() as capture:
        console.print(summary(solution, []))
        console.print(details(solution, "built-in", None))
    texts = {
        "repr": repr(solution),
        "summary": capture.get(),
        "notebook": unescape(solution._repr_html_()),
        "report": unescape(str(solution.report())),
        "title": title(solution),
    }
    for where, text in texts.items():
        told = {"conic": "Coulomb", "octagon": "octagonal"} if where == "title" else {}
        assert told.get(called, called) in text or (called, where) == ("conic", "summary")
        assert "interaction" not in text, where
        assert "moments" not in text, where
        assert "?" not in text.replace("which reading?", ""), where

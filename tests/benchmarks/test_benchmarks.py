"""The benchmark suite: every case small and right, baselines right, failures and charts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.__main__ import main
from benchmarks.baselines import baselines, edges, octagon_rows, program
from benchmarks.baselines import torsion_arms as printed_torsion_arms
from benchmarks.charts import exponent
from benchmarks.experiment import marked
from benchmarks.experiments import headline
from benchmarks.experiments.dome import least_thickness
from benchmarks.experiments.suite import (
    CASES,
    GROWTH,
    PER_CONTACT_LIMIT,
    SIZES,
    Record,
    growth_methods,
    measured,
    methods_of,
    run_size,
    sizes_of,
)
from benchmarks.rows import Rows
from benchmarks.runs import Limits
from benchmarks.scenes import scene_of

from cvxlimit import builtin_scene
from cvxlimit.compare.comparison import row_of
from cvxlimit.compare.models import Row
from cvxlimit.compare.registry import registry
from cvxlimit.errors import ModelError
from cvxlimit.masonry import arch
from cvxlimit.model.statics import Statics

TUFF_CONIC, TUFF_OCTAGON = 0.423056, 0.450034
S12_CONIC, S12_OCTAGON = 0.175819, 0.178313
PLAIN = [name for name, case in CASES.items() if not case.interaction]
SWEPT = {name: case for name, case in CASES.items() if len(case.sizes) > 1}
BASELINES = baselines()
QDLDL = "conic/corners/clarabel-qdldl/1e-8"
AMPLE = Limits(600.0)


def made_up(method, scene, seconds: float, contacts: int, error: float = 1e-6) -> Row:
    """A row as if measured: total time and memory given, the reference at 1."""
    phases = {"detect": 0.1 * seconds, "compile": 0.2 * seconds, "solve": 0.6 * seconds}
    factor = 1.0 + error
    run = Row(
        status="optimal", load_factor=factor, lower=1.0, upper=factor, total=seconds,
        memory=100.0 * seconds, **phases,
    )  # fmt: skip
    row = row_of(method, scene, [run], Row(status="proved to 0.0e+00", lower=1.0, upper=1.0))
    return replace(row, contacts=contacts)


def test_all_families_are_there():
    assert len(CASES) >= 8
    assert {case.interaction for case in CASES.values()} == {True, False}
    for case in CASES.values():
        assert set(case.study) <= set(case.sizes) or len(case.sizes) > 1
    assert sum(case.sizes == SIZES for case in CASES.values()) >= 4
    assert SIZES[0] == 50
    assert SIZES[-1] > 16_000


@pytest.mark.exhaustive_cases("arch")
@pytest.mark.parametrize("case", SWEPT.values(), ids=SWEPT)
def test_scenes_have_about_the_contacts_asked_for(case):
    for size in (150, 500, 1_900):
        assert len(case.build(size).contacts) == pytest.approx(size, rel=0.15)
    assert 25 <= len(case.build(50).contacts) <= 75


def test_the_largest_panel_is_the_one_the_issue_names():
    scene = CASES["panel"].build(16_452)
    assert (len(scene.free), len(scene.contacts)) == (5_560, 16_452)


def small(name: str, size: int, patterns: tuple[str, ...], folder) -> list[Record]:
    """Rows of a case at one size."""
    done = Rows(folder / "rows.jsonl", "case", "size", "method")
    return [r for found in measured(name, (size,), patterns, 1, AMPLE, done) for r in found]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", PLAIN)
def test_every_case_runs_small_and_is_right(name, tmp_path):
    case = CASES[name]
    patterns = ("cvxlimit",) if len(case.sizes) == 1 else ("cvxlimit", QDLDL)
    size = min(case.sizes)
    records = small(name, size, patterns, tmp_path)
    assert [record.row.method for record in records] == list(patterns)
    for record in records:
        row = record.row
        assert not row.failed, row.reason
        width = row.reference_upper - row.reference_lower
        assert width <= 2e-8 * row.reference_upper
        assert row.error <= 1e-5
        assert row.lower <= row.reference_upper
        assert row.reference_lower <= row.upper
        assert (record.case, record.family, record.size) == (name, case.family, size)
        assert Record.of(record.flat()) == record


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.interaction])
def test_cases_with_interaction_lie_below_those_without(name, tmp_path):
    (plain,) = small(name.removesuffix("-interaction"), 50, ("cvxlimit",), tmp_path)
    (record,) = small(name, 50, ("fixed-point/signed/conic",), tmp_path)
    assert not record.row.failed, record.row.reason
    assert 0.0 < record.row.load_factor <= plain.row.upper * (1.0 + 1e-6)
    assert record.row.interaction == "fixed-point"


@pytest.mark.exhaustive_cases("literal/octagon/kN-m/scipy")
@pytest.mark.parametrize("name", list(BASELINES))
def test_baselines_find_the_published_factors(name):
    method = BASELINES[name]
    found = method.measure(builtin_scene("tuff-wall"))
    expected = TUFF_CONIC if method.axes()["surface"] == "conic" else TUFF_OCTAGON
    loose = 1e-3 if name.endswith("N-mm") else 1e-5
    assert found.load_factor == pytest.approx(expected, rel=loose)
    assert found.compile + found.solve == pytest.approx(found.total)


@pytest.mark.exhaustive
def test_the_octagon_is_one_point_four_per_cent_off_on_the_s12_class_panel():
    found = registry()["octagon/corners/clarabel-qdldl/1e-8"].measure(CASES["s12-class"].build(886))
    assert found.load_factor == pytest.approx(S12_OCTAGON, rel=1e-5)
    assert found.load_factor / S12_CONIC - 1.0 == pytest.approx(0.0142, abs=2e-4)


def test_baselines_write_the_papers_rows_and_the_same_equilibrium():
    scene = builtin_scene("s12-panel")
    data = program(scene)
    contacts = scene.contacts
    rows = edges(contacts), octagon_rows(contacts, contacts.torsion_arm)
    assert [r.shape[0] for r in rows] == [4 * len(contacts), 16 * len(contacts)]
    assert abs(data.equilibrium - Statics.of(scene).matrix).max() < 1e-12
    assert printed_torsion_arms(contacts) == pytest.approx(contacts.torsion_arm, rel=1e-12)


def test_the_literal_form_refuses_contacts_the_paper_has_no_formula_for():
    scene = builtin_scene("tuff-wall")
    sides = np.full_like(scene.contacts.sides, np.nan)
    with pytest.raises(ModelError, match="rectangular"):
        printed_torsion_arms(replace(scene.contacts, sides=sides))
    assert np.isfinite(printed_torsion_arms(arch(4).contacts)).all()


def test_every_method_is_listed_once_and_growth_names_exist():
    for case in CASES.values():
        names = [method.name for method in methods_of(case)]
        assert len(names) == len(set(names))
        assert {m.name for m in growth_methods(case)} <= set(names)
    assert len(growth_methods(CASES["panel"])) >= len(GROWTH)


def test_sizes_of_cases_with_one_size():
    assert sizes_of(CASES["s12-class"], ()) == [886]
    assert sizes_of(CASES["s12-class"], (50, 150)) == []
    assert sizes_of(CASES["arch"], (150, 50)) == [50, 150]


def test_what_ran_out_of_time_is_not_tried_at_larger_sizes(monkeypatch):
    case, limits = CASES["arch"], Limits(0.01)
    monkeypatch.setattr("benchmarks.experiments.suite.REFERENCE_SECONDS", 0.01)
    methods = [BASELINES["literal/conic/kN-m"]]
    dropped: dict[str, str] = {}
    (first,) = run_size(case, 50, methods, 1, limits, dropped)
    assert "time limit of 0.01 s" in first.reason
    (second,) = run_size(case, 150, methods, 1, limits, dropped)
    assert second.reason == "not run: time limit of 0.01 s at 50 contacts"
    assert second.contacts == 150


def test_objects_per_contact_are_not_tried_on_large_scenes():
    methods = [BASELINES["literal/octagon/kN-m/per-contact"]]
    (row,) = run_size(CASES["arch"], PER_CONTACT_LIMIT + 100, methods, 1, AMPLE, {})
    assert "more than 500 contacts" in row.reason


NOTHING = Row(status="")


@pytest.mark.exhaustive
def test_charts_are_drawn_from_results_alone(tmp_path):
    scene, case = builtin_scene("stack"), CASES["propped-wall"]
    methods = [m for m in methods_of(case) if m.name in ("cvxlimit", "cvxlimit/1e-6")]
    kept = Rows(tmp_path / "rows.jsonl", "case", "size", "method")
    for size in (150, 500, 1_900, 5_000):
        for k, method in enumerate(methods):
            row = made_up(method, scene, (k + 1) * 1e-4 * size**1.3, size, 10.0 ** (-3 * k - 3))
            purpose = "study" if size == 150 else "growth"
            kept.add(Record("propped-wall", case.family, size, purpose, row, "made up").flat())
    options = ["--cases", "propped-wall", "--sizes", "150", "500", "1900", "5000"]
    methods = ["--methods", "cvxlimit", "cvxlimit/1e-6"]
    assert main(["run", "suite", *options, *methods, "--out", str(tmp_path)]) == 0
    kinds = ("time-against-error", "growth", "phases")
    names = {path.name for path in tmp_path.glob("*.png")}
    assert names == {f"{kind}-propped-walls.png" for kind in kinds}


def test_fitted_exponents_ignore_small_sizes():
    large = [(size, 2e-4 * size**1.5) for size in (500.0, 1_900.0, 16_452.0)]
    assert exponent([(50.0, 1.0), (150.0, 1.0), *large]) == pytest.approx(1.5)
    assert exponent([(50.0, 1.0), (500.0, 1.0)]) is None


@pytest.mark.exhaustive
def test_the_whole_command_on_one_small_case(tmp_path, capsys):
    options = ["--cases", "arch", "--sizes", "50", "--repeat", "1", "--out", str(tmp_path)]
    for _ in range(2):  # the second finds all rows there
        assert main(["run", "suite", *options, "--methods", "cvxlimit", "literal/conic/kN-m"]) == 0
    records = [Record.of(row) for row in Rows(tmp_path / "rows.jsonl", "case", "size", "method")]
    assert [r.row.method for r in records] == ["cvxlimit", "literal/conic/kN-m"]
    assert all(r.row.error < 1e-4 for r in records)
    assert "one run each" in records[0].about
    assert capsys.readouterr().out.count("| arch | 50 | cvxlimit |") == 1
    with pytest.raises(SystemExit, match="no case 'castle'"):
        main(["run", "suite", "--cases", "castle"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["suite", "--sizes", "-1"], "must be a whole number, 0 or above, got -1"),
        (["suite", "--limit", "nan"], "must be a number, 0 or above, got nan"),
        (["small", "--repeat", "two"], "must be a whole number, 0 or above, got two"),
        (["small", "--cases", "panel"], "unrecognized arguments: --cases panel"),
        (["castle"], "invalid choice: 'castle'"),
    ],
)
def test_options_without_sense_are_refused(options, message, capsys):
    with pytest.raises(SystemExit):
        main(["run", *options])
    assert message in capsys.readouterr().err


def test_nothing_runs_unasked(capsys):
    """All of it takes hours: it has to be named."""
    assert main([]) == 2
    assert "measure every figure" in " ".join(capsys.readouterr().out.split())


def test_interrupting_says_what_is_kept(capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("benchmarks.experiments.small.row", interrupted)
    assert main(["run", "small", "--scenes", "stack"]) == 130
    assert "interrupted; " in capsys.readouterr().out.replace("interrupted:", "interrupted; ")


def test_list_names_what_can_be_measured(capsys):
    assert main(["list"]) == 0
    shown = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert {"small", "suite", "atlas", "interaction", "closing", "headline"} <= set(shown)


@pytest.mark.parametrize("name", ["arch-50", "panel-500", "planar-wall-150", "wall-4", "drums-3"])
def test_scenes_have_names(name):
    assert len(scene_of(name).contacts) >= 1
    with pytest.raises(SystemExit, match="no scene 'castle-3'"):
        scene_of("castle-3")


@pytest.mark.exhaustive
def test_the_dome_is_bisected_between_what_falls_and_what_stands():
    """published.json: 12 x 12 blocks stand at 0.04207 of the radius and not at 0.04187."""
    low, high = least_thickness(12, 12, 4.0, 1.5e-4, low=0.04187, high=0.04207)
    assert 0.04187 <= low < high <= 0.04207
    assert high - low < 1.5e-4
    with pytest.raises(ModelError, match=r"does not lie between 0.043 and 0.05"):
        least_thickness(6, 6, 4.0, 1e-3, low=0.043)


def test_headline_checks_say_what_holds_and_what_does_not():
    scene = builtin_scene("stack").with_name("s12-class")
    ours = made_up(headline.OURS, scene, 1.0, 886)
    slow = made_up(headline.AGAINST[0], scene, 6.5, 886)
    quick = made_up(headline.AGAINST[1], scene, 5.9, 886)
    assert headline.ratio(ours, slow).holds
    assert "6.5 times" in headline.ratio(ours, slow).measured
    assert headline.ratio(ours, quick).holds is False
    wrong = replace(quick, error=0.16)
    assert headline.ratio(ours, wrong).holds is None
    assert "is 16% wrong" in headline.ratio(ours, wrong).promise
    assert headline.certified(replace(ours, upper=1.0 + 9e-7)).holds
    assert not headline.certified(replace(ours, upper=1.0 + 2e-6)).holds
    assert not headline.certified(replace(ours, upper=None)).holds
    failed = row_of(headline.OURS, scene, [Row(reason="crashed")], NOTHING)
    assert not headline.ratio(failed, slow).holds


def test_headline_sizes_and_growth():
    scene = builtin_scene("stack")
    rows = [made_up(headline.OURS, scene, 1e-3 * n**1.2, n) for n in (500, 1_900, 16_452)]
    lost = replace(rows[-1], contacts=50_546, total=None, reason="time limit of 200 s")
    checks = headline.growth_checks([*rows, lost])
    assert not checks[-1].holds
    assert checks[-1].measured == "time limit of 200 s"
    table = list(marked(headline.sizes_table([*rows, lost])))
    assert table[3].startswith("| 1,900 | 8.60 |")  # 1e-3 * 1900**1.2
    assert table[-1].endswith("| time limit of 200 s |")
    assert {line.count("|") for line in table} == {9}
    assert "total 1.20" in headline.bound(rows)

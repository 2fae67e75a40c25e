"""``compare`` on small scenes: rows, true errors, failures, table, chart."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from cvxlimit import builtin_scene, solve
from cvxlimit.compare import Comparison, compare
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.studies.chart import pareto_front
from cvxlimit.extensions.studies.comparison import side_by_side
from cvxlimit.extensions.studies.models import Model, Row, reference
from cvxlimit.model.formulations import resultants
from cvxlimit.scene import Load
from cvxlimit.solution.bracket import Bracket
from cvxlimit.solvers import settings_for
from cvxlimit.surfaces import Condition, Norm, Rocking, YieldSurface

TUFF_CONIC, TUFF_OCTAGON = 0.423056, 0.450034


class Misbehaving(Model):
    """Fails in the way it is told to."""

    def __init__(self, name: str, how: str) -> None:
        super().__init__(name, "misbehaving")
        self.how = how

    def measure(self, scene) -> Row:
        if self.how == "raise":
            raise ZeroDivisionError("by\nnought")
        status = "infeasible" if self.how == "no answer" else "optimal"
        factor = None if self.how == "no answer" else 0.4
        return Row(status=status, load_factor=factor, total=0.1)


@pytest.fixture(scope="module")
def tuff() -> Comparison:
    models = [
        "cvxlimit",
        "octagon/clarabel/1e-8",
        Model("mine", solver=settings_for("CLARABEL", 1e-3), formulation=resultants),
    ]
    return compare(builtin_scene("tuff-wall"), models, repeat=1, progress=False)


def test_rows_are_in_the_order_of_the_models_with_their_load_factors(tuff):
    names = [row.method for row in tuff.rows]
    assert names[:3] == ["cvxlimit", "octagon/clarabel/1e-8", "mine"]
    assert tuff.rows[0].load_factor == pytest.approx(TUFF_CONIC, rel=2e-6)
    assert tuff.rows[1].load_factor == pytest.approx(TUFF_OCTAGON, rel=2e-6)
    assert {row.contacts for row in tuff.rows} == {146}


def test_as_a_table(tuff):
    table = tuff.to_dataframe()
    assert list(table.index) == [row.method for row in tuff.rows]
    assert table.loc["cvxlimit", "load_factor"] == tuff.rows[0].load_factor
    assert set(table.index[table["is_on_front"]]) == set(tuff.front)


def test_errors_are_relative_to_the_cone_not_to_the_method_itself(tuff):
    by_name = {row.method: row for row in tuff.rows}
    octagon = by_name["octagon/clarabel/1e-8"]
    assert octagon.error == pytest.approx(TUFF_OCTAGON / TUFF_CONIC - 1.0, rel=1e-3)
    assert by_name["cvxlimit"].error < 1e-5
    assert 1e-5 < by_name["mine"].error < 1e-1
    lower, upper = octagon.reference_lower, octagon.reference_upper
    assert 0.0 <= upper - lower <= 1e-8 * upper
    assert octagon.reference == "certified"


def test_phases_add_up_to_no_more_than_the_total(tuff):
    for row in tuff.rows:
        if not row.failed:
            phases = [getattr(row, phase) for phase in ("detect", "compile", "solve", "certify")]
            known = [seconds for seconds in phases if seconds is not None]
            assert all(seconds >= 0.0 for seconds in known)
            assert 0.0 < sum(known) <= row.total * (1.0 + 1e-9)


def test_table_and_front_agree(tuff):
    lines = tuff.table().splitlines()
    assert len(lines) == 1 + len(tuff.rows) + 2  # what the star says, and the reference
    marked = [line.split()[1] for line in lines[1:-2] if line.startswith("*")]
    assert tuple(marked) == tuff.front
    assert tuff.front  # which ones is a matter of the machine's mood; the rule has its own test


def as_known(row: Row, width: float = 1e-6) -> Row:
    """With a reference of that relative width: how narrow ours is, depends on solvers."""
    low, high = TUFF_CONIC * (1 - width / 2), TUFF_CONIC * (1 + width / 2)
    return replace(row, reference_lower=low, reference_upper=high)


def test_plot_draws_every_line(tuff):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    tuff = Comparison(tuff.scene_name, tuple(as_known(row) for row in tuff.rows))
    figure = tuff.plot()
    labels = figure.axes[0].get_legend_handles_labels()[1]
    expected = {row.line for row in tuff.rows if not row.failed}
    expected.add("resolution of the reference")
    if len({row.line for row in tuff.rows if row.method in tuff.front}) > 1:  # as times have it
        expected.add("Pareto front")
    assert expected == set(labels)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == set(labels)
    assert figure._repr_png_().startswith(b"\x89PNG")
    own = Figure()
    assert tuff.plot(own.add_subplot()) is own


def test_without_matplotlib_the_error_names_the_extra(tuff, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ModelError, match=r"cvxlimit\[plot\]"):
        tuff.plot()


def test_scenes_with_and_without_interaction_have_truths_of_their_own(tuff):
    """Their truths differ, so each has its reference and its legend entry."""
    plain = as_known(next(row for row in tuff.rows if row.method == "cvxlimit"))
    other = replace(plain, method="certified", line="certified", moments="signed",
                    reference_lower=0.3628, reference_upper=0.3643)  # fmt: skip
    figure = Comparison("mixed", (plain, other)).plot()
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert labels.count("resolution of the reference, no interaction") == 1
    assert labels.count("resolution of the reference, signed moments") == 1
    assert not [label for label in labels if "Pareto" in label]  # one model in either


def test_nothing_to_draw_is_refused():
    with pytest.raises(ModelError, match="nothing to draw"):
        Comparison("empty", ()).plot()


@pytest.mark.exhaustive_cases("no answer-no load factor: infeasible")
@pytest.mark.parametrize(
    ("how", "reason"),
    [("raise", "ZeroDivisionError: by nought"), ("no answer", "no load factor: infeasible")],
)
def test_failures_become_rows(how, reason):
    row = compare(builtin_scene("stack"), [Misbehaving("bad", how)], repeat=1, progress=False).rows[
        0
    ]
    assert (row.failed, row.reason) == (True, reason)
    assert row.load_factor is None


@pytest.mark.exhaustive
def test_surfaces_and_functions_that_no_module_holds():
    """As in a notebook: a class and a function that another process cannot import."""

    class Ellipse(YieldSurface):
        name = "ellipse"

        def conditions(self, contacts):
            size = Norm({"V1": 1}, {"V2": 1}, {"MT": 1 / contacts.torsion_arm})
            return [Condition([size], {"N": contacts.friction})]

    scene = builtin_scene("tuff-wall")
    model = Model("mine", surface=[Rocking(), Ellipse()], formulation=lambda c: resultants(c))
    row = compare(scene, model, repeat=1, progress=False).rows[0]
    assert not row.failed
    assert row.load_factor == pytest.approx(
        solve(scene, [Rocking(), Ellipse()]).load_factor, rel=1e-5
    )


@pytest.mark.exhaustive
def test_a_failure_is_not_repeated_and_the_others_go_on():
    models = [Misbehaving("bad", "raise"), Model.named("cvxlimit")]
    steps: list[str] = []
    rows = side_by_side(models, builtin_scene("stack"), 2, steps.append).rows
    assert [row.failed for row in rows] == [True, False]
    assert [row.runs for row in rows] == [0, 2]
    assert steps == ["reference", *2 * ["bad", "cvxlimit"]]


def interrupted_at(run: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C during the run of this number, counted from the reference's."""
    runs = iter(range(run))

    def measured(method, scene):
        if next(runs, None) is None:
            raise KeyboardInterrupt
        return Misbehaving("run", "not at all").measure(scene)

    monkeypatch.setattr("cvxlimit.extensions.studies.comparison.run_here", measured)


@pytest.mark.parametrize(
    ("run", "kept"), [(2, [1]), (3, [1, 1]), (4, [1, 1, 1]), (5, [2, 1, 1]), (6, [2, 2, 1])]
)
def test_rows_measured_before_an_interrupt_are_returned(run, kept, monkeypatch):
    models = ["cvxlimit", "cvxlimit/1e-6", "cvxlimit/1e-8"]
    interrupted_at(run, monkeypatch)
    found = compare(builtin_scene("stack"), models, repeat=2, progress=False)
    assert found.is_interrupted
    assert [row.method for row in found.rows] == models[: len(kept)]
    assert [row.runs for row in found.rows] == kept
    assert found.table().splitlines()[-1].startswith("interrupted")


def test_an_interrupt_after_the_last_run_does_not_exist(monkeypatch):
    interrupted_at(7, monkeypatch)
    models = ["cvxlimit", "cvxlimit/1e-6", "cvxlimit/1e-8"]
    found = compare(builtin_scene("stack"), models, repeat=2, progress=False)
    assert not found.is_interrupted
    assert "interrupted" not in found.table()


STUCK = """
import time
from cvxlimit.compare import Model, compare
from cvxlimit import builtin_scene

class Stuck(Model):
    def measure(self, scene):
        if len(scene.contacts) > 1:
            print("under way", flush=True)
            time.sleep(3600)

found = compare(builtin_scene("stack"), ["cvxlimit", Stuck("stuck")], repeat=1, progress=False)
print([row.method for row in found.rows], found.is_interrupted)
"""


@pytest.mark.exhaustive
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_in_a_script_of_ones_own():
    """Once the second model runs: the first one's row is there."""
    process = subprocess.Popen(
        [sys.executable, "-c", STUCK],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored in background
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "under way\n"
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=600)
    assert (process.returncode, out, err) == (0, "['cvxlimit'] True\n", "")


@pytest.mark.parametrize("run", [0, 1])
def test_an_interrupt_before_anything_was_measured_goes_on_upward(run, monkeypatch):
    interrupted_at(run, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        compare(builtin_scene("stack"), ["cvxlimit"], repeat=2, progress=False)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Model("x", tolerance="1e-6"),
            "tolerance must be between 0 and 1, got '1e-6'",
        ),
        (
            lambda: Model("x", tolerance=-1.0),
            "tolerance must be between 0 and 1, got -1.0",
        ),
        (lambda: Model("x", formulations=resultants), "no option 'formulations'.*'formulation'"),
        (lambda: Model("x", solver="no such"), "there is no solver 'NO SUCH'"),
        (lambda: Model("x", method="certifid"), "method must be one of .*'certifid'"),
        (lambda: Model("x", moments="foo"), "moments must be one of independent, signed"),
        (lambda: compare("tuff-wall"), "scene must be a Scene, got 'tuff-wall'"),
    ],
)
def test_refused_before_anything_runs(make, message):
    with pytest.raises((InputError, ModelError), match=message):
        make()


@pytest.mark.parametrize(
    ("models", "repeat", "message"),
    [
        (["no-such"], 1, "no model is called 'no-such': "),
        (["ecos/1e-8"], 1, "solver ECOS is not installed; it comes with "),
        (["octogon"], 1, "no model is called 'octogon': .*; did you mean 'octagon'"),
        ([], 1, "nothing to compare"),
        ([3], 1, "must be names or Model objects"),
        (3, 1, "must be names or Model objects"),
        ([Model("a"), Model("a", tolerance=0.1)], 1, "two models are called 'a'"),
        (["cvxlimit"], 0, "repeat must be"),
        (["cvxlimit"], True, "repeat must be"),
    ],
)
def test_refusals(models, repeat, message):
    with pytest.raises(ModelError, match=message):
        compare(builtin_scene("single-block"), models, repeat=repeat, progress=False)


@pytest.mark.exhaustive
def test_facets_on_both_sides_of_the_cone():
    """Polygons bracket the cone, and twice as many facets have a fourth of the error."""
    found = compare(builtin_scene("tuff-wall"), facets=[8, 32], repeat=1, progress=False)
    cone, *polygons = found.rows
    assert [row.facets for row in found.rows] == [None, 8, 32, 8, 32]
    for row in polygons:
        assert (row.load_factor < cone.load_factor) == row.surface.endswith("-inscribed")
    for coarse, fine in (polygons[:2], polygons[2:]):
        assert 8.0 < coarse.error / fine.error < 32.0
    assert [row.line for row in polygons[::2]] == ["facets outside the cone",
                                                   "facets inside the cone"]  # fmt: skip


@pytest.mark.parametrize("name", ["16-gon", "cvxlimit/16-gon", "cvxlimit/16-gon-inscribed"])
@pytest.mark.exhaustive_cases("16-gon", "cvxlimit/16-gon")
def test_surfaces_by_the_names_that_sweeps_take(name):
    (row,) = compare(builtin_scene("stack"), [name], repeat=1, progress=False).rows
    assert row.surface == name.removeprefix("cvxlimit/")
    assert not row.failed


def test_a_bad_scene_is_refused_before_anything_runs():
    from cvxlimit import Block, Scene

    far = Block.box("far", (5, 5, 5), (6, 6, 6), density=1.0)
    ground = Block.box("ground", (0, 0, -1), (1, 1, 0))
    scene = Scene([ground, far], ["ground"], Load(acceleration=(1, 0, 0)))
    with pytest.raises(InputError, match="touches no other block"):
        compare(scene, ["cvxlimit"], progress=False)


@pytest.mark.parametrize(
    ("name", "options", "line"),
    [
        ("cvxlimit", {}, "cvxlimit"),
        ("cvxlimit/1e-8", {"tolerance": 1e-8}, "cvxlimit"),
        ("full/parabolic", {"model": "full", "surface": "parabolic"}, "full/parabolic"),
        ("16-gon-inscribed", {"surface": "16-gon-inscribed"}, "facets inside the cone"),
        ("paper/certified", {"method": "certified", "moments": "paper"}, "paper/certified"),
        ("octagon/scs", {"surface": "octagon", "solver": "SCS"}, "facets outside the cone/scs"),
    ],
)
def test_parts_of_a_name_are_options(name, options, line):
    model = Model.named(name)
    assert (model.options, model.line) == (options, line)


def test_a_tolerance_beside_a_solver_is_the_solvers_own():
    (option,) = Model.named("clarabel/1e-3").options.items()
    assert option == ("solver", settings_for("CLARABEL", 1e-3))


def test_errors_with_interaction_are_measured_with_the_same_reading():
    readings = {"certified": "independent", "fixed-point/paper": "paper", "cvxlimit": "",
                "exact": "", "zero-dilatancy": ""}  # fmt: skip
    assert {name: Model.named(name).moments for name in readings} == readings


def test_a_model_that_makes_no_sense_is_refused():
    with pytest.raises(ModelError, match="at least 3 facets, got 2"):
        Model("x", surface="2-gon")


@pytest.mark.parametrize(
    ("points", "front"),
    [
        ([], []),
        ([(1.0, 1.0)], [0]),
        ([(2.0, 1.0), (1.0, 2.0), (3.0, 3.0)], [1, 0]),
        ([(1.0, 1.0), (1.0, 1.0)], [0]),
        ([(1.0, 2.0), (1.0, 1.0)], [1]),
        ([(1.0, 1.0), (2.0, 1.0)], [0]),
    ],
)
def test_pareto_front(points, front):
    assert pareto_front(points) == front


@pytest.mark.parametrize(
    ("lower", "upper", "value", "error"),
    [
        (1.0, 1.0, 1.01, 0.01),
        (0.8, 1.0, 0.9, 0.1),
        (0.8, 1.0, 1.2, 0.4),
        (-np.inf, np.inf, 1.0, None),
    ],
)
def test_error_against_a_bracket_is_the_worst_case(lower, upper, value, error):
    found = Bracket(lower, upper).error(value)
    assert found == (None if error is None else pytest.approx(error))
    assert Bracket(lower, upper).error(None) is None


@pytest.mark.parametrize(
    ("name", "factor"),
    [("single-block", 0.4), ("ferris-tin-loi-1", 0.642859), ("tuff-wall", TUFF_CONIC)],
)
def test_references_are_narrow_and_right(name, factor):
    found = reference("").measure(builtin_scene(name))
    assert found.lower <= found.upper <= found.lower * (1.0 + 1e-8)
    assert found.load_factor == pytest.approx(factor, rel=2e-6)

"""Methods of the benchmarks by name: every axis is there, and other physics is right on a block."""

from __future__ import annotations

from dataclasses import replace

import pytest
from benchmarks.registry import choose, registry

from cvxlimit import Tie, builtin_scene, solve


def test_the_registry_has_every_axis() -> None:
    methods = registry()
    assert all(name == method.name for name, method in methods.items())
    plain = [m for name, m in methods.items() if "/" in name and not m.moments]
    polygons = {f"{n}{s}" for n in ("octagon", "16-gon", "32-gon", "64-gon")
                for s in ("", "-inscribed")}  # fmt: skip
    assert {m.axes()["surface"] for m in plain} == {"conic", *polygons}
    solvers = {str(m.options.get("solver", "ladder")) for m in methods.values()}
    assert {"Clarabel qdldl", "Clarabel faer", "HiGHS ipm", "HiGHS simplex", "SCS", "ECOS", "QOCO",
            "MOSEK", "GUROBI", "CUOPT"} <= solvers  # fmt: skip
    assert len([n for n in methods if n.startswith("conic/corners/clarabel-qdldl/")]) >= 5
    kinds = {(m.options["method"], m.moments) for m in methods.values() if m.moments}
    readings = ("independent", "signed", "paper")
    assert kinds == {(k, m) for k in ("fixed-point", "certified") for m in readings}


def test_patterns_choose_in_registered_order() -> None:
    chosen = choose(["16-gon*", "cvxlimit"], list(registry().values()))
    assert [m.name for m in chosen] == [
        "cvxlimit",
        "16-gon/corners/clarabel-qdldl/1e-8",
        "16-gon-inscribed/corners/clarabel-qdldl/1e-8",
    ]


class TestPhysics:
    """Other physics of the same blocks, on one whose answers are known in closed form."""

    @pytest.mark.exhaustive
    def test_rows_of_all_models(self) -> None:
        """A block of b/h = 0.4: it tips about its edge, or about its crushed toe at
        (b - W / (f l)) / h with strength f; with mortar it takes more."""
        scene = builtin_scene("single-block")
        names = ("linear", "parabolic", "exact", "without-ties", "zero-dilatancy", "incremental")
        chosen = choose([*names, "crushing/*", "mortar"], list(registry().values()))
        rows = {model.name: model.measure(scene) for model in chosen}
        for name in names:
            assert rows[name].load_factor == pytest.approx(0.4, rel=1e-3)
        for times in (10.0, 100.0):
            crushed = rows[f"crushing/{times:g}"].load_factor
            assert crushed == pytest.approx(0.4 * (1.0 - 1.0 / times), rel=1e-5)
            field = rows[f"crushing/{times:g}/field"].load_factor
            assert 0.4 * (1 - 1 / 8) * (1 - 1e-6) - 0.4 / times < field < 0.4  # eight cells across
        assert rows["mortar"].load_factor > 0.401

    def test_what_ties_are_worth(self) -> None:
        scene = replace(
            builtin_scene("single-block"), ties=(Tie("ground", "b1", (0, 0, 0), (0, 0, 1), 1.0),)
        )
        assert solve(scene).load_factor > 0.45
        model = registry()["without-ties"]
        assert model.measure(scene).load_factor == pytest.approx(0.4, rel=1e-5)

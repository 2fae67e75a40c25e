"""Tables of solutions and what notebooks show: against closed forms, and without surprises."""

from __future__ import annotations

import json
import pickle
import sys
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from cvxlimit import Block, Incremental, Load, Scene, Solution, builtin_scene, solve
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io import read_result, write_result
from cvxlimit.plotting import notebook
from cvxlimit.solution import Step
from cvxlimit.solution.bracket import rounded
from cvxlimit.surfaces import Rocking, Sliding, Torsion, TorsionShear, utilisation

pandas = pytest.importorskip("pandas")

LENGTH, WIDTH, HEIGHT, DENSITY, MU = 1.0, 0.6, 2.5, 20.0, 0.7
WEIGHT = DENSITY * LENGTH * WIDTH * HEIGHT


def tower(name: str = "tower") -> Scene:
    ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
    stone = Block.box("stone", (0, 0, 0), (LENGTH, WIDTH, HEIGHT), density=DENSITY)
    push = Load(acceleration=(1, 0, 0))
    return Scene([ground, stone], ["ground"], push, friction=MU, name=name)


@pytest.fixture(scope="module")
def solved() -> Solution:
    return solve(tower())


class TestContacts:
    """The tower rocks about its foot at length / height: everything in the table is known."""

    def test_forces_and_pressure_centre(self, solved: Solution) -> None:
        row = solved.to_dataframe().iloc[0]
        factor = LENGTH / HEIGHT
        assert (row["a"], row["b"]) == ("ground", "stone")
        assert row["N"] == pytest.approx(WEIGHT, rel=1e-6)
        assert row["shear"] == pytest.approx(factor * WEIGHT, rel=1e-5)
        assert row[["px", "py", "pz"]].to_list() == pytest.approx([LENGTH, WIDTH / 2, 0], abs=1e-5)
        assert abs(row["e1"]) + abs(row["e2"]) == pytest.approx(LENGTH / 2, abs=1e-5)

    def test_utilisation(self, solved: Solution) -> None:
        row = solved.to_dataframe().iloc[0]
        assert row["utilisation_rocking"] == pytest.approx(1.0, abs=1e-5)
        assert row["utilisation_sliding"] == pytest.approx(LENGTH / HEIGHT / MU, rel=1e-5)
        assert row["utilisation_torsion"] == pytest.approx(0.0, abs=1e-5)
        assert row["utilisation"] == row["utilisation_rocking"]

    def test_rates_are_those_of_live_power_one(self, solved: Solution) -> None:
        row = solved.to_dataframe().iloc[0]
        turning = 1.0 / (WEIGHT * HEIGHT / 2)  # about the foot, so that the live load's power is 1
        assert row["opening"] == pytest.approx(turning * LENGTH, rel=1e-4)
        assert row["slip"] == pytest.approx(0.0, abs=1e-4 * turning)
        assert row["state"] == "opens"

    def test_units_and_descriptions_cover_the_columns(self, solved: Solution) -> None:
        table = solved.to_dataframe("contacts")
        assert set(table.attrs["description"]) == set(table.columns)
        assert table.attrs["units"]["N"] == "kN"
        assert table.attrs["units"]["MT"] == "kN\u00b7m"
        assert table.attrs["lower"] <= table.attrs["load_factor"] <= table.attrs["upper"]
        assert table.index.name == "contact"

    def test_a_solution_without_forces_and_mechanism_has_blanks(self) -> None:
        nothing = replace(solve(tower()), forces=None, mechanism=None)
        table = nothing.to_dataframe()
        assert table[["N", "utilisation", "opening", "twist"]].isna().all(axis=None)
        assert set(table["state"]) == {""}


def test_blocks(solved: Solution) -> None:
    table = solved.to_dataframe("blocks")
    assert table.loc["stone", "weight"] == pytest.approx(WEIGHT)
    assert np.isnan(table.loc["ground", "weight"])
    assert table["is_support"].to_dict() == {"ground": True, "stone": False}
    assert table.loc["stone", "speed"] == 1.0
    assert table.loc["stone", "ry"] == pytest.approx(2.0 / (WEIGHT * HEIGHT), rel=1e-4)


def test_history(solved: Solution) -> None:
    table = solved.to_dataframe("history")
    assert len(table) == len(solved.history)
    assert table["solver"].tolist() == [iterate.solver for iterate in solved.history]


@pytest.mark.parametrize("name", ["tuff-wall", "dome"])
def test_utilisation_is_the_paper_s_equations(name: str) -> None:
    """Eq. 9, 10, 17 and 24 written out once more, contact by contact."""
    contacts = builtin_scene(name).contacts
    forces = np.random.default_rng(5).normal(size=(len(contacts), 6)) * 0.1
    forces[:, 2] = np.random.default_rng(6).uniform(0.5, 2.0, len(contacts))
    found = [utilisation(s, forces, contacts) for s in (Rocking(), Sliding(), Torsion())]
    both = utilisation(TorsionShear(), forces, contacts)
    for j, (v1, v2, n, m1, m2, mt) in enumerate(forces.tolist()):
        centre, corners = np.array([-m2 / n, m1 / n]), contacts.corners_of(j)
        used = 0.0
        for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            outward = np.array([q[1] - p[1], p[0] - q[0]])
            used = max(used, float(outward @ centre) / float(outward @ p))
        friction = contacts.friction[j] * n
        shear, torsion = np.hypot(v1, v2) / friction, abs(mt) / contacts.torsion_arm[j] / friction
        assert [f[j] for f in found] == pytest.approx([used, shear, torsion], rel=1e-9)
        assert both[j] == pytest.approx(shear + torsion, rel=1e-9)


def test_a_joint_that_carries_nothing_uses_nothing_it_has() -> None:
    contacts = builtin_scene("tuff-wall").contacts
    forces = np.zeros((len(contacts), 6))
    forces[0, 2] = 1.0
    assert np.isnan(utilisation(Sliding(), forces, contacts)[1:]).all()
    assert utilisation(Sliding(), forces, contacts)[0] == 0.0


def test_nothing_exceeds_the_surfaces_that_were_solved_with() -> None:
    solution = solve(builtin_scene("dome"))
    used = solution.to_dataframe()["utilisation"]
    assert used.max() == pytest.approx(1.0, abs=1e-4)


class TestScenesOfSolutions:
    def test_a_pickle_keeps_the_scene(self, solved: Solution) -> None:
        again = pickle.loads(pickle.dumps(solved))
        assert again.to_dataframe().equals(solved.to_dataframe())

    def test_a_file_loses_it_and_of_gives_it_back(self, solved: Solution, tmp_path) -> None:
        write_result(solved, tmp_path / "tower.json")
        read = read_result(tmp_path / "tower.json")
        with pytest.raises(InputError, match=r"'tower' has no scene, .* solution.of"):
            replace(read, contact_names=()).to_dataframe()  # as files of earlier versions have none
        assert read.of(tower()).to_dataframe().equals(solved.to_dataframe())

    def test_a_file_names_contacts_components_and_units(self, solved: Solution, tmp_path) -> None:
        """Forces and rates as tables, without the scene; by hand as well."""
        write_result(solved, tmp_path / "tower.json")
        read = read_result(tmp_path / "tower.json")
        for what, last in (("contacts", "shear"), ("blocks", "rz")):
            whole, bare = solved.to_dataframe(what), read.to_dataframe(what)
            assert bare.columns[-1] == last
            pandas.testing.assert_frame_equal(bare, whole.loc[bare.index, bare.columns])
            assert bare.attrs["units"].items() <= whole.attrs["units"].items()
        document = json.loads((tmp_path / "tower.json").read_text())
        by_hand = pandas.DataFrame(
            document["forces"], document["contact_names"], document["components"]["forces"]
        )
        assert by_hand["N"].tolist() == solved.to_dataframe()["N"].tolist()

    def test_another_scene_is_refused(self, solved: Solution) -> None:
        with pytest.raises(InputError, match="has 1 free blocks, but scene 'stack' has 5"):
            solved.of(builtin_scene("stack"))
        with pytest.raises(InputError, match="mechanism lacks block 'b1'"):
            solved.of(builtin_scene("single-block"))

    def test_mortar_that_became_a_load_is_not_seen(self) -> None:
        glued = replace(tower(), cohesion=2.0, tensile_strength=1.0)
        assert solve(glued).solved_scene is glued


def test_another_table_is_refused(solved: Solution) -> None:
    with pytest.raises(InputError, match="choose one of contacts, blocks, history"):
        solved.to_dataframe("forces")  # type: ignore[arg-type]


def test_missing_pandas_names_the_command(solved: Solution, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModelError, match=r'tables need pandas: pip install "cvxlimit\[frames\]"'):
        solved.to_dataframe()


class TestLines:
    @pytest.mark.parametrize("name", ["single-block", "tuff-wall", "s10-panel"])
    def test_a_scene_is_one_line(self, name: str) -> None:
        text = repr(builtin_scene(name))
        assert text.startswith(f"Scene('{name}': ")
        assert len(text) < 100
        assert "\n" not in text

    def test_a_solution_is_one_line_with_its_bracket(self, solved: Solution) -> None:
        factor = rounded(solved.load_factor)
        inside = f"load factor {factor} in {solved.bracket}"
        assert repr(solved) == f"Solution('tower', conic: {inside}, certified)"

    def test_without_an_answer_it_says_why(self) -> None:
        harmless = solve(tower().with_live(Load(acceleration=(0, 0, -1))))
        assert repr(harmless) == "Solution('tower', conic: live load does no harm)"


class Tags(HTMLParser):
    """Names of elements, in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append(tag)


class TestNotebooks:
    HOSTILE = "<script>alert(1)</script>&"

    def test_a_solution_shows_picture_and_bracket(self, solved: Solution) -> None:
        text = solved._repr_html_()
        assert Tags(text).found.count("img") == 1
        assert "<b>0.4000000</b>" in text
        assert "certified" in text

    def test_texts_of_the_scene_are_no_markup(self) -> None:
        scene = tower(self.HOSTILE)
        for text in (scene._repr_html_(), solve(scene)._repr_html_()):
            assert "script" not in Tags(text).found
            assert "&lt;script&gt;" in text

    def test_a_refused_scene_says_why(self) -> None:
        ground = Block.box("ground", (-1, -1, -1), (2, 2, 0))
        floating = Block.box("floating", (0, 0, 5), (1, 1, 6), density=1.0)
        text = Scene([ground, floating], ["ground"], Load(acceleration=(1, 0, 0)))._repr_html_()
        assert "refused" in text
        assert "floating" in text

    def test_figures_come_without_matplotlib(self, solved: Solution, monkeypatch) -> None:
        monkeypatch.setitem(sys.modules, "matplotlib", None)
        text = solved._repr_html_()
        assert "img" not in Tags(text).found
        assert "<b>0.4000000</b>" in text

    def test_huge_scenes_are_not_drawn_unasked(self, solved: Solution, monkeypatch) -> None:
        monkeypatch.setattr(notebook, "_MOST_BLOCKS", 1)
        assert "img" not in Tags(solved._repr_html_()).found


class TestInteraction:
    """Eq. 30 written out once more, contact by contact, under each reading's own torque."""

    @pytest.mark.parametrize("moments", ["independent", "signed", "paper"])
    def test_utilisation_is_eq_30(self, moments: str, solved: Solution) -> None:
        scene = builtin_scene("tuff-wall")
        contacts = scene.contacts
        rng = np.random.default_rng(3)
        forces = rng.normal(size=(len(contacts), 6)) * 0.1
        forces[:, 2] = rng.uniform(0.5, 2.0, len(contacts))
        forces[:, 3] *= contacts.sides[:, 1]
        forces[:, 4] *= contacts.sides[:, 0]
        found = replace(
            solved, scene_name=scene.name, blocks=len(scene.free), contacts=len(contacts),
            forces=forces, mechanism=None, interaction="certified", moments=moments,
            solved_scene=scene,
        )  # fmt: skip
        table = found.to_dataframe()
        for j, (v1, v2, n, m1, m2, mt) in enumerate(forces.tolist()):
            eps1, eps2 = abs(m2) / n, abs(m1) / n
            arm = _arm(contacts.sides[j, 0] - 2 * eps1, contacts.sides[j, 1] - 2 * eps2)
            torque = {
                "independent": abs(v1) * eps2 + abs(v2) * eps1 + abs(mt),
                "signed": abs(mt + m2 / n * v2 + m1 / n * v1),  # e1 = -M2 / N, e2 = M1 / N
                "paper": abs(mt + eps2 * v1 + eps1 * v2),
            }[moments]
            strength = contacts.friction[j] * n
            used = np.hypot(v1, v2) / strength + torque / (arm * strength)
            if moments == "paper":  # Eq. 27 stands beside it
                used = max(used, abs(mt) / (arm * strength))
            row = table.iloc[j]
            assert row["utilisation_torsion_shear_bending"] == pytest.approx(used, rel=1e-6)
            assert row["utilisation"] == pytest.approx(max(used, row["utilisation_rocking"]))

    def test_no_joint_of_a_certified_state_exceeds_it(self) -> None:
        found = solve(tower(), method="certified")
        table = found.to_dataframe()
        assert table["utilisation"].max() == pytest.approx(1.0, abs=1e-4)
        assert table.attrs["moments"] == "independent"

    def test_without_interaction_there_is_no_such_column(self, solved: Solution) -> None:
        assert "utilisation_torsion_shear_bending" not in solved.to_dataframe()


def _arm(l1: float, l2: float) -> float:
    """Eq. 16 as the mean distance from the centre of a rectangle, by quadrature."""
    x, w = np.polynomial.legendre.leggauss(60)
    x, w = 0.5 + 0.5 * x, 0.5 * w  # a quarter of the rectangle
    return float(w @ np.hypot(0.5 * l1 * x[:, None], 0.5 * l2 * x) @ w)


def test_steps_are_a_table_with_and_without_the_scene(tmp_path: Path) -> None:
    found = solve(builtin_scene("single-block"), method=Incremental(spread=False))
    table = found.to_dataframe("steps")
    assert table["load_factor"].max() == found.load_factor == pytest.approx(0.4, rel=1e-6)
    assert table["open"].tolist() == [step.open for step in found.steps]
    assert {*table.columns} == {f.name for f in fields(Step)} - {"forces"}
    assert {*table.attrs["description"]} == {*table.columns}
    write_result(found, tmp_path / "found.json")
    assert read_result(tmp_path / "found.json").to_dataframe("steps").equals(table)
    with pytest.raises(InputError, match="method='incremental'"):
        solve(builtin_scene("single-block")).to_dataframe("steps")

"""Paths proved again from what they hold, found anew in between, and continued."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest

from cvxlimit import (
    Block,
    Configuration,
    Load,
    Path,
    Scene,
    builtin_scene,
    code_check,
    prove,
    pushover,
)
from cvxlimit.errors import InputError, ModelError
from cvxlimit.extensions.paths.between import configuration_at
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.path import Work
from cvxlimit.io import read_path
from leaves import unnoticed
from turning import END, B, H, angle_at, turning, wall


@pytest.fixture(scope="module")
def path() -> Path:
    return pushover(wall(1), step=0.08, until=0.1)


def test_a_file_is_proved_from_what_it_holds(path: Path, tmp_path: File) -> None:
    path.save(tmp_path / "path.json")
    proof = prove(tmp_path / "path.json")
    assert proof.is_proved
    assert f"{len(path)} configurations in equilibrium, {len(path)} of them with br" in str(proof)
    assert prove(path, wall(1)).is_proved
    with pytest.raises(InputError, match="of another scene"):
        prove(path, wall(3))


def test_the_run_with_half_the_step_is_proved_as_well(path: Path) -> None:
    half = pushover(wall(1), step=0.04, until=0.1)
    wrong = replace(half, configurations=(half[0], turned(half[1]), *half.configurations[2:]))
    assert prove(replace(path, halved=half)).is_proved
    assert not prove(replace(path, halved=path)).is_proved  # no half of the step
    proof = prove(replace(path, halved=wrong))
    assert not proof.is_proved
    assert "displacements of configuration 1 with half the step" in str(proof)


Change = Callable[[Configuration], Configuration]


def turned(c: Configuration) -> Configuration:
    more = {block: way + np.array([0, 0, 0, 0, 1e-4, 0]) for block, way in c.displacements.items()}
    return replace(c, displacements=more)


def shifted(c: Configuration) -> Configuration:
    """Forces that act 0.1 mm beside the corner: better for the wall, and no contact is there."""
    return replace(c, points=replace(c.points, at=c.points.at + np.array([1e-4, 0, 0])))


@pytest.mark.parametrize(
    ("change", "claims"),
    [
        (lambda c: replace(c, load_factor=1.001 * c.load_factor), {"equilibrium"}),
        (lambda c: replace(c, w=c.w + 1e-4), {"w"}),
        (turned, {"w", "displacements", "points", "equilibrium", "lower", "upper"}),
        (shifted, {"points", "equilibrium"}),
        (lambda c: replace(c, forces=1.001 * c.forces), {"equilibrium"}),
        (lambda c: replace(c, forces=c.forces * [1, 1, 0] + [0, 0, 9]), {"friction"}),
        (lambda c: replace(c, points=replace(c.points, friction=c.points.friction + 1)), {"points"}),  # noqa: E501
        (lambda c: replace(c, bracket=replace(c.bracket, lower=c.bracket.lower + 1e-3)), {"lower"}),
        (lambda c: replace(c, bracket=replace(c.bracket, upper=c.bracket.upper - 1e-3)), {"upper"}),
    ],
)  # fmt: skip
def test_what_was_changed_is_not_proved(path: Path, change: Change, claims: set[str]) -> None:
    made = list(path)
    made[1] = change(made[1])
    proof = prove(replace(path, configurations=tuple(made), work=None))
    missing = {check.claim.split()[0] for check in proof.missing}
    assert missing & claims


def test_other_claims_that_were_changed_are_not_proved(path: Path) -> None:
    assert path.work is not None
    other = Work(path.work.area + 1e-3, path.work.potential)
    assert [c.claim for c in prove(replace(path, work=other)).missing] == ["area and potential"]
    initial = replace(path.initial, load_factor=0.21)
    assert not prove(replace(path, initial=initial)).is_proved


def claims_missing(path: Path) -> set[str]:
    return {check.claim for check in prove(path).missing}


@pytest.fixture(scope="module")
def whole() -> Path:
    """A wall that rocks until nothing holds it any more."""
    return pushover(wall(1), step=0.08)


@pytest.mark.parametrize("status", ["falls", "blocked", "steps", "not-converged", "interrupted"])
def test_a_path_that_has_come_to_its_end_did_not_end_otherwise(whole: Path, status: str) -> None:
    assert whole.status == "zero"
    assert claims_missing(replace(whole, status=status)) == {f"status {status!r}"}


@pytest.mark.parametrize("status", ["zero", "falls", "blocked", "not-converged"])
@pytest.mark.exhaustive_cases("falls", "blocked")
def test_a_path_cut_short_has_not_come_to_its_end(whole: Path, status: str) -> None:
    cut = whole.configurations[:-1]
    short = replace(whole, configurations=cut, status=status, work=None)
    assert f"status {status!r}" in claims_missing(short)
    assert "area and potential" in claims_missing(short)
    named = prove(replace(short, status="interrupted")).of("not looked at")
    assert "status 'interrupted'" in [check.claim for check in named]


def test_configurations_that_are_missing_leave_too_long_a_step(whole: Path) -> None:
    first, _, *others = whole.configurations
    changed = replace(whole, configurations=(first, *others))
    assert {"step 0.08", "area and potential"} <= claims_missing(changed)
    assert claims_missing(replace(whole, configurations=whole.configurations[1:])) & {
        "start at rest"
    }


def test_a_jump_that_is_none_is_not_proved(whole: Path) -> None:
    assert "1 jumps" in claims_missing(replace(whole, snaps=(float(whole.w[1]),)))


def test_a_path_that_slides_says_so() -> None:
    """A block on its face slides as far as one likes."""
    ground, cube = Block.box("g", (-5, -5, -1), (5, 5, 0)), Block.box("c", (0, 0, 0), (1, 1, 1), 1)
    scene = Scene([ground, cube], ["g"], Load(acceleration=(1, 0, 0)), friction=0.3, name="cube")
    path = pushover(scene, step=0.2, until=0.29, flow="zero-dilatancy")
    path = replace(path, configurations=path.configurations[:3], status="interrupted")
    again = replace(path, work=Work(0.3 * path.w[2], 0.0))
    assert "no joint slides" in claims_missing(replace(again, slides=False))
    named = [check.claim for check in prove(again).of("not looked at")]
    assert "what half the step changes" in named


def test_the_load_factor_asked_for_is_kept(path: Path, tmp_path: File) -> None:
    path.save(tmp_path / "path.json")
    assert read_path(tmp_path / "path.json").until == 0.1
    assert claims_missing(replace(path, until=0.0)) == {"status 'zero'"}


@pytest.mark.filterwarnings("error")
def test_a_path_without_a_dead_load_is_proved_without_a_warning() -> None:
    scene = replace(wall(1), dead=Load())
    held = pushover(wall(1), step=0.08, until=0.15)
    made = tuple(replace(c, start=scene) for c in held)
    assert "equilibrium of configuration 0" in claims_missing(
        replace(held, configurations=made, initial=held.initial)
    )


def test_a_path_goes_on_as_if_it_had_never_ended(path: Path, tmp_path: File) -> None:
    path.save(tmp_path / "path.json")
    on, whole = pushover(read_path(tmp_path / "path.json")), pushover(wall(1), step=0.08)
    assert on.status == "zero"
    assert on.d0 == pytest.approx(B / 2, abs=1e-8)
    assert on.d0 == pytest.approx(whole.d0, abs=1e-8)
    assert on.load_factor[: len(path)].tolist() == path.load_factor.tolist()
    assert prove(on).is_proved
    assert pushover(on).w.tolist() == on.w.tolist()


def test_a_configuration_between_two_of_the_path_has_the_closed_form_and_a_bracket(
    path: Path,
) -> None:
    """Of any control point; along a slope, the rise of the centre counts too."""
    found = configuration_at(path, 0.05)
    angle = angle_at(0.05)
    assert found.load_factor == pytest.approx(np.tan(END - angle), abs=1e-9)
    assert found.bracket is not None
    assert found.bracket.width < 1e-9
    rise = H / 2 * (np.cos(angle) - 1) + B / 2 * np.sin(angle)
    slope = replace(path, control=("c0", (3.0, 0.0, 4.0)))
    assert configuration_at(slope, 0.6 * 0.05 + 0.8 * rise).w == pytest.approx(0.05, abs=1e-8)


def test_the_code_check_does_not_depend_on_the_steps() -> None:
    one = code_check(pushover(wall(1), step=0.09, certify="none"), 1.0)
    assert pytest.approx(1.384597, abs=1e-6) == one.T_SLV
    assert pytest.approx(1.932296, abs=1e-6) == one.T_SLC
    assert one.slv.configuration.bracket is not None
    assert one.slv.configuration.bracket.width < 1e-9


def test_what_does_not_begin_or_go_on_is_refused(path: Path) -> None:
    with pytest.raises(ModelError, match="control names 'c9'"):
        pushover(path, control=("c9", (1, 0, 0)))


def test_a_snap_is_not_interpolated_across(path: Path) -> None:
    snapped = replace(path, snaps=(float(path.w[1]),))
    assert configuration_at(snapped, 0.5 * (path.w[1] + path.w[2])) is path[2]


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", ["arch", "tuff-wall"])
def test_paths_that_snap_or_slide_are_proved_again(name: str) -> None:
    """Flush stones of the wall touch at corners that lie on edges but for what iterates leave."""
    path = pushover(builtin_scene(name))
    assert path.snaps or path.slides
    assert prove(path).is_proved


def test_an_exact_path_that_no_solver_made_is_refused_where_it_holds_no_forces() -> None:
    """Displacements alone prove nothing: equilibrium is that of forces at points."""
    missing = prove(turning(wall(1), (0.0, 0.05))).missing
    assert "equilibrium" in {check.claim.split(" of ")[0] for check in missing}


@pytest.mark.parametrize("end", ["lower", "upper"])
def test_a_weaker_bracket_of_a_configuration_is_not_proved(path: Path, end: str) -> None:
    first = path[0]
    assert first.bracket is not None
    value = getattr(first.bracket, end)
    weaker = replace(first.bracket, **{end: value + (0.01 if end == "upper" else -0.01)})
    changed = replace(
        path, configurations=(replace(first, bracket=weaker), *path.configurations[1:])
    )
    assert any(c.claim.startswith(f"{end} bound") for c in prove(changed).missing)


@pytest.mark.exhaustive
def test_every_leaf_of_a_path_counts(path: Path) -> None:
    """A longer step, and another load factor to stop at, are what was asked for; the scene beside
    has the names of contacts."""
    given = json.loads(json.dumps(PATH.to_dict(path)))
    asked = ("step", "until", "contact_names", "tolerance", "surface")
    assert not unnoticed(given, lambda d: prove(PATH.from_dict(d)), every=7, asked=asked)

"""The code check against closed forms of a wall that turns about its toe, in 1, 3 and 8 courses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cvxlimit import Block, Load, Scene, Units, pushover
from cvxlimit.errors import InputError
from cvxlimit.extensions.paths import code_check as checking
from cvxlimit.extensions.paths.checked import CodeCheck
from cvxlimit.extensions.paths.code_check import code_check
from turning import ANGLES, END, B, H, turning, wall

G = 9.81


def checked(courses: int, **options: object) -> CodeCheck:
    return code_check(turning(wall(courses), ANGLES), 1.0, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("courses", [1, 3, 8])
def test_a_wall_in_courses_has_its_closed_form(courses: int) -> None:
    check, n = checked(courses), courses
    e_star = 3 * n**2 / (4 * n**2 - 1)
    assert check.e_star == pytest.approx(e_star, rel=1e-8)
    assert check.a0_star == pytest.approx(B / H * G / e_star, rel=1e-8)
    assert check.d0 == pytest.approx(B / 2 / e_star, rel=1e-8)
    assert check.d_SLV == pytest.approx(0.4 * check.d0, rel=1e-8)
    assert check.d_SLC == pytest.approx(0.6 * check.d0, rel=1e-8)
    assert pytest.approx(1.384597, abs=2e-6) == check.T_SLV  # whatever the number of courses
    assert pytest.approx(1.932296, abs=2e-6) == check.T_SLC


def test_grouped_courses_count_as_one_block() -> None:
    one, grouped = checked(1), checked(8, groups=[[f"c{i}" for i in range(8)]])
    for name in ("e_star", "a0_star", "d0", "d_SLV", "d_SLC", "T_SLV", "T_SLC", "weight"):
        assert getattr(grouped, name) == pytest.approx(getattr(one, name), rel=1e-8)


@pytest.mark.parametrize("groups", [[], [["c0", "c1"]], [["c0", "c1", "c2"]]])
@pytest.mark.parametrize("courses", [1, 3])
def test_with_their_own_inertia_neither_courses_nor_groups_matter(
    courses: int, groups: list[list[str]]
) -> None:
    """Displacements that grow with height z from 0 at the toe: (z)^2 / (z^2) in the mean is 3/4."""
    groups = groups if courses == 3 else []
    check, n = checked(courses, groups=groups, own_inertia=True), 1e9
    assert check.e_star == pytest.approx(0.75, rel=1e-8)
    assert check.e_star == pytest.approx(3 * n**2 / (4 * n**2 - 1), rel=1e-8)
    assert check.d0 == pytest.approx(B / 2 / 0.75, rel=1e-8)
    assert pytest.approx(1.384597, abs=2e-6) == check.T_SLV
    assert "over the bodies" in str(check)


def test_periods_grow_with_the_confidence_factor_and_not_with_units_or_the_push() -> None:
    one = checked(3)
    for scene in (
        wall(3).in_units(Units("mm", "N"), 1e3, 1e3),
        wall(3).in_units(Units("ft", "kN"), 1 / 0.3048, 1.0),
        wall(3).with_live(Load(acceleration=(2.5, 0.0, 0.0))),
    ):
        length = scene.blocks[1].vertices[:, 0].max() / B
        path = turning(scene, ANGLES)
        size = scene.live.acceleration[0]  # type: ignore[index]
        path = replace(path, configurations=tuple(
            replace(c, load_factor=c.load_factor / size) for c in path.configurations
        ))  # fmt: skip
        check = code_check(path, 1.35)
        assert pytest.approx(one.T_SLV * np.sqrt(1.35), rel=1e-8) == check.T_SLV
        assert check.d_SLC == pytest.approx(one.d_SLC * length, rel=1e-8)
        assert check.a0_star == pytest.approx(one.a0_star * length / 1.35, rel=1e-8)


def test_a_control_point_elsewhere_gives_the_same_spectral_displacement_at_first() -> None:
    """Top and centre have moved in proportion while angles are small."""
    path = turning(wall(3), (0.0, 1e-4, END))
    top = replace(path, control=("c2", (1.0, 0.0, 0.0)))
    one, other = code_check(path), code_check(top)
    assert other.e_star == one.e_star
    assert other.displacement[1] == pytest.approx(one.displacement[1], rel=1e-4)
    assert path.displacement[1] < 0.7 * top.displacement[1]


def test_local_failures_and_snaps_come_before_the_shares_of_d0() -> None:
    check = checked(3, local_failure=0.06)
    assert check.d_SLV == check.d_SLC == pytest.approx(0.06 / check.e_star)
    assert check.slv.basis == "the local failure given"
    path = turning(wall(3), ANGLES)
    configurations = [*path.configurations]
    for i in range(2, len(configurations) - 1):  # what is left after a tie, say, has failed
        configurations[i] = replace(configurations[i], load_factor=0.01)
    snapped = code_check(
        replace(path, configurations=tuple(configurations), snaps=(float(path.w[1]),))
    )
    assert snapped.d_SLV == pytest.approx(path.w[1] / check.e_star)
    assert "snap" in snapped.slv.basis
    assert snapped.d0 == pytest.approx(check.d0)


def test_a_limit_state_between_two_steps_without_one_at_rest_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its acceleration is that of the next step, farther on than the displacement beside it."""
    assert checked(1).slc.basis == "0.6 d0"  # type: ignore[union-attr]
    monkeypatch.setattr(checking, "configuration_at", lambda path, at: path[len(path) - 1])
    check = checked(1)
    assert check.slc is not None
    assert check.slc.acceleration == pytest.approx(0.0, abs=1e-6)
    assert f"none is known to rest there: a is that of the next, {check.d0:.4g}" in str(check)


def test_where_joints_slide_the_check_is_of_the_run_with_the_least_d0() -> None:
    """Which is the unfavourable end of their interval, whichever run it is of."""
    path = turning(wall(1), ANGLES)
    short = replace(path, configurations=tuple(
        replace(c, load_factor=path[0].load_factor * (1.0 - 2.0 * a / END))
        for c, a in zip(path, ANGLES, strict=True)
    ))  # fmt: skip
    assert short.d0 < path.d0
    for given, name in (
        (replace(path, halved=short, notes=("both",)), "with half the step"),
        (replace(short, halved=path, notes=("both",)), "with the whole step"),
        (replace(path, other_flow=short, notes=("both",)), "by the other flow rule"),
    ):
        check = code_check(given)
        assert check.d0 == code_check(short).d0
        assert check.d_SLV == pytest.approx(0.4 * check.d0)
        assert f"{check.d0:.4g} to {code_check(path).d0:.4g} by the step" in check.ends
        assert check.notes == ("both", f"the check is of the run {name}: the least d0 of 2")
    broken = replace(short, configurations=short.configurations[:2], status="not-converged")
    check = code_check(replace(path, halved=broken))
    assert check.acceleration.tolist() == code_check(path).acceleration.tolist()
    assert check.notes[-1].endswith("with the whole step; 1 has no d0")
    assert "by the step" not in check.ends  # of one run


def test_what_fails_in_any_run_comes_before_the_least_d0() -> None:
    """The run whose d0 is larger snaps early: of what may happen the unfavourable counts."""
    path = turning(wall(3), ANGLES)
    weak = [replace(c, load_factor=0.01) if 1 < i < len(path) - 1 else c
            for i, c in enumerate(path)]  # fmt: skip
    snapping = replace(path, configurations=tuple(weak), snaps=(float(path.w[1]),))
    short = replace(path, configurations=tuple(
        replace(c, load_factor=path[0].load_factor * (1.0 - 1.02 * a / END))
        for c, a in zip(path, ANGLES, strict=True)
    ))  # fmt: skip
    alone, both = code_check(snapping), code_check(replace(short, halved=snapping))
    assert both.d0 == code_check(short).d0 < alone.d0
    assert both.d_SLV == alone.d_SLV < 0.4 * both.d0
    assert both.slv.basis == f"{alone.slv.basis}, with half the step"


@pytest.mark.parametrize("has_half", [False, True])
def test_a_run_by_the_other_rule_that_slides_away_has_no_d0(has_half: bool) -> None:
    path = turning(wall(1), ANGLES)
    gone = pushover(wall(1).with_friction(0.1), certify="none", halvings=0)
    assert gone.slides_away
    check = code_check(replace(path, halved=path if has_half else None, other_flow=gone))
    assert check.d0 == code_check(path).d0
    assert check.notes[-1].endswith("; 1 has no d0")


def test_what_friction_at_points_adds_is_told() -> None:
    path = turning(wall(1), ANGLES)
    more = replace(path, initial=replace(path.initial, load_factor=path.load_factor[0] / 1.05))
    assert code_check(path).notes == path.notes
    check = code_check(more)
    assert "another load factor, of the path, friction at points, has +5.0% of a0*" in str(check)
    assert check.a0_star == pytest.approx(code_check(path).a0_star / 1.05)  # the least one leads


def test_where_nothing_holds_the_wall_any_more_it_ends_there() -> None:
    path = turning(wall(1), ANGLES[:-1])
    check = code_check(replace(path, status="falls", reason="c0 falls"))
    assert check.d0 == path.w[-1]
    assert "falls" in check.ends


def test_what_the_code_does_not_speak_of_is_refused() -> None:
    path = turning(wall(3), ANGLES[:-1])
    with pytest.raises(InputError, match=r"ends at .* follow it until 0"):
        code_check(path)
    whole = turning(wall(3), ANGLES)
    for groups, said in (
        ([["c0", "c9"]], "'c9', which is no free block"),
        ([["c0"], ["c1", "c0"]], "'c0' is in two groups"),
    ):
        with pytest.raises(InputError, match=said):
            code_check(whole, groups=groups)
    with pytest.raises(InputError, match="confidence factor must be above 0"):
        code_check(whole, 0.0)
    for scene, said in (
        (wall(3).in_units(Units("ell", "kN"), 1.0, 1.0), "unit 'ell'"),
        (wall(3, (1.0, 0.0, 0.5)), "must be a horizontal acceleration"),
        (wall(3).with_live(Load(forces={"c2": (1, 0, 0, 0, 0, 0)})), "must be a horizontal"),
    ):
        with pytest.raises(InputError, match=said):
            code_check(turning(scene, ANGLES))


def test_blocks_that_stand_still_do_not_count_and_cannot_be_grouped_with_others() -> None:
    beside = Block.box("pier", (-0.8, 0, 0), (-0.2, 1, 0.3), density=20.0)
    scene = wall(1)
    both = Scene([*scene.blocks, beside], ["ground"], scene.live, friction=0.7)
    path = turning(both, ANGLES)
    still = tuple(
        replace(c, displacements=c.displacements | {"pier": np.zeros(6)},
                w=c.w * scene.total_weight / both.total_weight) for c in path.configurations
    )  # fmt: skip
    found, alone = (
        code_check(replace(path, configurations=still)),
        code_check(turning(scene, ANGLES)),
    )
    for name in ("weight", "e_star", "a0_star", "d0", "T_SLV"):
        assert getattr(found, name) == pytest.approx(getattr(alone, name), rel=1e-7)
    with pytest.raises(InputError, match="do not move as one"):
        code_check(replace(path, configurations=still), groups=[["c0", "pier"]])


def test_the_report_names_every_quantity_and_its_source() -> None:
    check = checked(3)
    table = check.to_dataframe().set_index("quantity")
    assert table.loc["T_SLV", "value"] == check.T_SLV
    assert table.loc["a SLV", "value"] == 2.0 * table.loc["a SLD", "value"] == 2.0 * check.a0_star
    for said in ("e*", "d_SLC", "1.93", "Circolare 7/2019", "compared with the code in force"):
        assert said in str(check)

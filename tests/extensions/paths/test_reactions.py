"""Reactions along a path: forces between bounds, each at a point that moves with its block."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from cvxlimit import (
    Block,
    Load,
    Path,
    Reaction,
    Road,
    Scene,
    Tie,
    code_check,
    passive,
    prove,
    pushover,
    solve,
)  # fmt: skip
from cvxlimit.extensions.paths.bars import Bars
from cvxlimit.extensions.paths.bonds import Bonds
from cvxlimit.extensions.paths.files import PATH
from cvxlimit.extensions.paths.following import Walk
from cvxlimit.extensions.paths.pairs import Pose
from cvxlimit.extensions.paths.resting import FARTHEST, Failed
from cvxlimit.io import json_schema, read_path
from cvxlimit.masonry import Arch, bridge, single_block, stack
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.scene.loads import PointForce
from cvxlimit.surfaces import Rocking
from displaced import assert_balanced_within_friction
from linkages import rocking, turned

B, WIDTH, H = 0.4, 0.5, 1.0
GROUND = Block.box("ground", (-5, -5, -1), (5, 5, 0))
PUSH = Load(acceleration=(1, 0, 0))


def block(*reactions: Reaction, friction: float = 2.0) -> Scene:
    return replace(single_block((B, WIDTH, H), friction=friction), reactions=reactions)


def turn_of(path: Path, name: str = "b1") -> Any:
    return [float(x.displacements[name][4]) for x in path]


def _after(steps: int) -> Callable[[str], None]:
    """What interrupts a path after so many steps: what slides goes on to the end of its support."""
    lines: list[str] = []

    def stop(line: str) -> None:
        lines.append(line)
        if len(lines) == steps:
            raise KeyboardInterrupt

    return stop


def on_its_toe(scene: Scene, turn: float, *forces: tuple[float, float, float]) -> float:
    """Load factor of the block that has turned about its toe, under forces along x (size, and x and
    z of their points of action at rest)."""
    left, weight = np.arctan2(B, H) - turn, scene.total_weight * 0.5 * np.hypot(B, H)
    holds = [-size * turned(turn, np.array([x - B, z]))[1] for size, x, z in forces]
    return float((weight * np.sin(left) + sum(holds)) / (weight * np.cos(left)))


@pytest.mark.parametrize(
    ("side", "direction", "least", "most", "size"),
    [
        pytest.param(B, -1, 0.0, 1.5, -1.5, id="against"),
        pytest.param(B, -1, 0.4, 1.5, -1.5, id="against, of two bounds",
                     marks=pytest.mark.exhaustive),
        pytest.param(0.0, 1, 0.0, 1.5, 0.0, id="behind", marks=pytest.mark.exhaustive),
        pytest.param(0.0, 1, 0.4, np.inf, 0.4, id="behind, following"),
        pytest.param(0.0, 1, -0.4, 1.5, -0.4, id="that pulls back", marks=pytest.mark.exhaustive),
    ],
)  # fmt: skip
def test_a_block_that_turns_is_pushed_by_the_bound_that_its_movement_asks_for(
    side: float, direction: int, least: float, most: float, size: float, tmp_path: File
) -> None:
    """At most where the point moves against the push, at least where it moves along with it; the
    direction stays, and the point of action moves with the block."""
    scene = block(Reaction("b1", (side, 0.25, 0.6), (direction, 0, 0), most, least))
    path = pushover(scene, step=0.06)
    exact = [on_its_toe(scene, turn, (size, side, 0.6)) for turn in turn_of(path)]
    assert path.load_factor == pytest.approx(exact, abs=1e-8)
    assert path.status == "zero"
    for shown in path:
        assert_balanced_within_friction(shown)
        assert shown.bracket is not None
        assert shown.bracket.is_proved
        assert shown.bracket.lower - 1e-8 <= shown.load_factor <= shown.bracket.upper + 1e-8
        assert shown.bracket.upper - shown.bracket.lower < 1e-7
    assert path.work is not None
    assert abs(path.work.difference) < 1e-3  # over few steps, with what the reaction has taken up
    path.save(tmp_path / "path.json")
    Draft202012Validator(json_schema("path")).validate(PATH.to_dict(path))
    assert prove(tmp_path / "path.json").is_proved
    # gone on from the file, and begun again from the displaced scene
    on = pushover(read_path(tmp_path / "path.json"), until=-0.05, certify="none")
    exact = [on_its_toe(scene, turn, (size, side, 0.6)) for turn in turn_of(on)]
    assert on.load_factor == pytest.approx(exact, abs=1e-8)
    again = pushover(path[2].scene(), until=path.load_factor[2] - 1e-3, certify="none")
    assert again.load_factor[0] == pytest.approx(path.load_factor[2], abs=1e-7)
    assert any("no stiffness" in note for note in path.notes)


@pytest.mark.parametrize("ahead", [True, False])
def test_a_block_that_slides_has_soil_before_it_and_none_behind(ahead: bool) -> None:
    """Without dilatancy: alpha = mu + most / W, or mu - least / W."""
    at, push = ((1.0, 0.25, 0.1), (-1, 0, 0)) if ahead else ((0.0, 0.25, 0.1), (1, 0, 0))
    bare = single_block((1.0, 0.5, 0.3), friction=0.3)
    scene = replace(bare, reactions=(Reaction("b1", at, push, 1.0, 0.25),))
    path = pushover(scene, step=0.1, flow="zero-dilatancy", progress=_after(4))
    exact = 0.3 + (1.0 if ahead else -0.25) / scene.total_weight
    assert path.load_factor == pytest.approx([exact] * 4, abs=1e-7)
    for shown in path:
        assert_balanced_within_friction(shown)
        assert shown.bracket is not None
        assert shown.bracket.is_proved
        assert shown.bracket.lower - 1e-7 <= exact <= shown.bracket.upper + 1e-7
    assert prove(path).is_proved


@pytest.mark.exhaustive
def test_a_path_that_slides_to_the_end_of_its_support_is_proved_to_its_end() -> None:
    """It tips over there, in a step that slides first: every slip counts from the configuration
    before, as the file has it."""
    scene = replace(
        single_block((1.0, 0.5, 0.3), friction=0.3),
        reactions=(Reaction("b1", (1.0, 0.25, 0.1), (-1, 0, 0), 1.0),),
    )
    for flow in ("associated", "zero-dilatancy"):
        path = pushover(scene, step=0.05, flow=flow)  # type: ignore[arg-type]
        assert path.slides_away
        assert prove(path).is_proved


def test_a_prop_at_the_toe_holds_what_would_slide() -> None:
    """It pushes as much as it has to, and does not give way: as rough a bed."""
    prop = Reaction("b1", (B, 0.25, 0.0), (-1, 0, 0), np.inf)
    path = pushover(block(prop, friction=0.1), step=0.06)
    assert path.load_factor == pytest.approx([rocking(B, H, w) for w in path.w], abs=1e-8)
    for shown in path:
        assert_balanced_within_friction(shown)
        assert shown.points.gap[shown.points.is_bar] == pytest.approx([0.0], abs=1e-8)
        assert shown.scene().reactions[0].most == np.inf
        assert shown.bracket is not None
        assert shown.bracket.is_proved
    assert not path.slides
    assert prove(path).is_proved


def test_soil_before_a_wall_pushes_at_all_depths() -> None:
    """Passive pressure on the lowest 0.3 of the face to which the wall turns."""
    bare = block()
    soil = passive(bare, 0.3, unit_weight=18.0, coefficient=3.0, blocks=["b1"])
    soil = tuple(each for each in soil if each.direction[0] < 0.0)  # before it
    scene = replace(bare, reactions=soil)
    path = pushover(scene, step=0.06, certify="last")
    forces = [(-each.most, each.at[0], each.at[2]) for each in soil]
    exact = [on_its_toe(scene, turn, *forces) for turn in turn_of(path)]
    assert path.load_factor == pytest.approx(exact, abs=1e-7)
    assert path.load_factor[0] > B / H + 1e-3
    bracket = path[-1].bracket
    assert bracket is not None
    assert bracket.is_proved
    check = code_check(path)
    assert check.d0 == pytest.approx(path.d0, rel=1e-6)
    assert any("no stiffness" in note for note in check.caveats)


def test_a_tie_is_a_reaction_that_pulls_between_two_blocks() -> None:
    """Two blocks on one bed, the second pushed away from the first: while they slide along their
    line both are the same, and the load factor is friction and strength over the push."""
    blocks = [GROUND, *(Block.box(n, (x, 0, 0), (x + 1, 1, 0.4), density=density)
                        for n, x, density in (("a", -1.5, 90.0), ("b", 1.0, 20.0)))]  # fmt: skip
    live = Load(forces={"b": (1, 0, 0, 0, 0, 0)})
    tie = Tie("a", "b", (-0.5, 0.5, 0.0), (1.0, 0.5, 0.0), 2.0)
    tied = Scene(blocks, ["ground"], live, friction=0.4, ties=[tie])
    pull = Reaction("b", (1.0, 0.5, 0.0), (1, 0, 0), 0.0, least=-2.0, on="a")
    exact = 0.4 * 8.0 + 2.0
    for scene, stretch in ((tied, 9.0), (replace(tied, ties=(), reactions=(pull,)), None)):
        start = pushover(scene, until=2.0 * exact, stretch=stretch, flow="zero-dilatancy")
        assert len(start) == 1  # it ends where it begins, and goes on from there
        path = pushover(start, step=0.1, until=0.0, progress=_after(3))
        assert path.load_factor == pytest.approx([exact] * 4, abs=1e-6)
        assert path.failures == ()
        assert prove(path).is_proved


def test_forces_between_blocks_that_move_as_one_change_nothing() -> None:
    """Its direction turns with the block that it pushes from: two blocks on one toe are a wall."""
    low = Block.box("low", (0, 0, 0), (B, WIDTH, 0.4), 20.0)
    up = Block.box("up", (0, 0, 0.4), (B, WIDTH, H), 20.0)
    between = Reaction("up", (0.1, 0.2, 0.7), (1, 0.5, -0.2), 0.9, 0.6, on="low")
    scene = Scene([GROUND, low, up], ["ground"], PUSH, friction=2.0, reactions=[between])
    path = pushover(scene, step=0.06, certify="last")
    assert path.load_factor == pytest.approx([rocking(B, H, w) for w in path.w], abs=1e-7)
    turn = turn_of(path, "low")[2]
    way = turned(turn, np.array(between.direction)[[0, 2]])
    assert np.array(path[2].scene().reactions[0].direction)[[0, 2]] == pytest.approx(way)
    assert prove(path).is_proved


def test_a_force_without_room_between_its_bounds_is_a_point_load() -> None:
    scene = block(Reaction("b1", (0.0, 0.25, 0.6), (1, 0, 0), 0.4, 0.4))
    load = Load(gravity=(0, 0, -1), points=[PointForce("b1", (0.0, 0.25, 0.6), (0.4, 0, 0))])
    paths = [pushover(each, step=0.06, certify="last") for each in (scene, block().with_dead(load))]
    assert paths[0].load_factor == pytest.approx(paths[1].load_factor, abs=1e-9)
    assert paths[0].work == pytest.approx(paths[1].work, rel=1e-6)
    assert prove(paths[0]).is_proved


def test_a_force_of_next_to_nothing_changes_nothing() -> None:
    bare = pushover(block(), step=0.06, certify="none")
    path = pushover(block(Reaction("b1", (B, 0.25, 0.6), (-1, 0, 0), 1e-8)), step=0.06)
    assert path.load_factor == pytest.approx(bare.load_factor, abs=1e-8)
    assert all(shown.bracket is not None and shown.bracket.is_proved for shown in path)


def test_what_has_given_way_is_remembered_and_a_prop_gives_way_nowhere() -> None:
    """Pushed in by 0.1 and back by 0.04: what yields is short of its seat by 0.04, and what does
    not is back by nothing that it has moved in the meantime."""
    scene = block(
        Reaction("b1", (B, 0.25, 0.6), (-1, 0, 0), 1.0),
        Reaction("b1", (0, 0.25, 0.6), (1, 0, 0), np.inf),
    )
    first, free = Pose.first(scene), scene.free

    def at(x: float) -> Pose:
        return first.moved(free, np.array([[x, 0, 0, 0, 0, 0]]))

    bonds = Bonds.first(scene, 0.0)
    assert bonds is not None
    for x, yielding, prop in ((0.1, 0.0, 0.1), (0.06, 0.04, 0.06), (0.0, 0.1, 0.0)):
        bonds = bonds.after(at(x))
        gaps = bonds.seat - Bars(scene).at(at(x))[2]
        assert gaps == pytest.approx([yielding, prop], abs=1e-15)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("side", "direction", "least", "size"), [(B, -1, 0.25, -1.5), (0.0, 1, 0.25, 0.25)]
)
def test_explicit_steps_know_reactions(
    side: float, direction: int, least: float, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no iterates come to rest, as here by order, the closed form is met up to the square of
    how far each step goes; by either flow rule."""
    monkeypatch.setattr(
        Walk, "settle", lambda self, _, w: Failed(w, "not-converged", np.ones(len(self.radius)))
    )
    path = pushover(block(Reaction("b1", (side, 0.25, 0.6), (direction, 0, 0), 1.5, least)))
    assert path.status == "zero"
    assert all(shown.is_followed for shown in path[1:])
    runs = [path, path.other_flow]
    for run in runs:
        assert run is not None
        exact = [on_its_toe(path.scene, turn, (size, side, 0.6)) for turn in turn_of(run)]
        assert run.load_factor == pytest.approx(exact, abs=FARTHEST**2)
    assert any(shown.bracket is not None for shown in path[1:])
    assert prove(path).is_proved


@pytest.mark.exhaustive
def test_explicit_steps_know_ties_and_where_they_come_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Behind a block on its toe, of 1 m, until it is 0.05 m longer: moments by hand."""
    monkeypatch.setattr(
        Walk, "settle", lambda self, _, w: Failed(w, "not-converged", np.ones(len(self.radius)))
    )
    wall, anchor = block(), Block.box("anchor", (-1.1, 0, 0), (-1.0, 0.5, 0.9))
    tie = Tie("anchor", "b1", (-1, 0.25, 0.8), (0, 0.25, 0.8), yield_force=1.0)
    scene = replace(wall, blocks=(*wall.blocks, anchor), supports=("ground", "anchor"), ties=(tie,))
    path = pushover(scene, stretch=0.05)
    assert path.status == "zero"
    ((torn, name),) = path.failures
    assert name == "tie anchor-b1"
    lengths = []
    for shown, turn in zip(path, turn_of(path), strict=True):
        arm = turned(turn, np.array([-B, 0.8]))
        way = np.array([-1.0, 0.8]) - arm - [B, 0.0]
        lengths.append(float(np.linalg.norm(way)))
        pull = way / lengths[-1] * (shown.w <= torn)
        weight = wall.total_weight * 0.5 * np.hypot(B, H)
        tips = pull[0] * arm[1] - pull[1] * arm[0]
        exact = on_its_toe(wall, turn) - tips / (weight * np.cos(np.arctan2(B, H) - turn))
        assert shown.load_factor == pytest.approx(exact, abs=FARTHEST**2)
    last = int(np.flatnonzero(path.w == torn)[0])
    assert lengths[last] <= 1.05 < lengths[last + 1]
    assert prove(path).is_proved


@pytest.fixture(scope="module")
def held() -> Path:
    scene = block(Reaction("b1", (B, 0.25, 0.6), (-1, 0, 0), 1.5, 0.25))
    return pushover(scene, step=0.1)


@pytest.mark.parametrize("values", [{"most": 2.0}, {"least": 0.5}, {"is_bar": False}])
def test_bounds_that_were_changed_are_not_proved(held: Path, values: dict[str, Any]) -> None:
    points, made = held[1].points, list(held)
    changed = {
        name: np.where(points.is_bar, x, getattr(points, name)) for name, x in values.items()
    }
    made[1] = replace(held[1], points=replace(points, **changed))
    missing = [x.claim for x in prove(replace(held, configurations=tuple(made))).missing]
    assert any("configuration 1" in claim for claim in missing), missing
    assert prove(held).is_proved


def test_files_that_know_ties_alone_are_read(tmp_path: File) -> None:
    """As they were written before there were reactions: without the last two columns."""
    tie = Tie("anchor", "b1", (-1, 0.25, 0.8), (0, 0.25, 0.8), 0.2)
    anchor = Block.box("anchor", (-1.1, 0, 0), (-1, WIDTH, 0.9))
    wall = single_block((B, WIDTH, H), friction=2.0)
    scene = replace(wall, blocks=(*wall.blocks, anchor), supports=("ground", "anchor"), ties=(tie,))
    path = pushover(scene, step=0.1, stretch=9.0)
    document = PATH.to_dict(path)
    for shown in document["configurations"]:
        shown["points"] = [row[:-2] for row in shown["points"]]
    file = tmp_path / "path.json"
    file.write_text(json.dumps(document), encoding="utf-8")
    Draft202012Validator(json_schema("path")).validate(document)
    found = read_path(file)
    assert found[1].points.is_bar.tolist() == path[1].points.is_bar.tolist()
    assert len(found[1].scene().ties) == 1
    assert prove(file).is_proved


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(12))
def test_random_walls_with_reactions_keep_the_laws(seed: int) -> None:
    """Stacks under an oblique push. Their first load factor is that of forces at the corners of
    contacts, which is another way to it; their configurations are in balance and within bounds."""
    random = np.random.default_rng(seed)
    way = random.uniform(-0.6, 0.6)
    push = Load(acceleration=(np.cos(way), np.sin(way), 0.0))
    scene = stack(3, (0.5, 0.4, 0.3), friction=float(random.uniform(0.8, 2.0))).with_live(push)
    free, reactions = [scene.blocks[i] for i in scene.free], []
    for _ in range(3):
        one, other = random.choice(len(free), 2, replace=False)
        low, high = free[one].vertices.min(axis=0), free[one].vertices.max(axis=0)
        at = tuple(random.uniform(low, high).tolist())
        least, most = np.sort(random.uniform(-0.3, 0.6, 2)).tolist()
        on = free[other].id if random.random() < 0.4 else None
        most = np.inf if random.random() < 0.2 else most
        toward = tuple(random.normal(size=3).tolist())
        reactions.append(Reaction(free[one].id, at, toward, most, least, on=on))
    scene = replace(scene, reactions=tuple(reactions))
    found = solve(scene, [Rocking()], formulation=vertex_forces)
    assert found.load_factor is not None
    path = pushover(scene, step=0.02, until=0.05 * found.load_factor, certify="last")
    assert path.load_factor[0] == pytest.approx(found.load_factor, rel=1e-6)
    for shown in path:
        p, n = shown.points, shown.forces[:, 0]
        assert (n <= p.most + 1e-7 * scene.total_weight).all()
        assert (n >= p.least - 1e-7 * scene.total_weight).all()
        assert p.depth <= 1e-7 * scene.contacts.typical_size
    if path.slides:  # what friction has opened counts as closed along the path alone
        return
    shown = path[len(path) // 2]
    again = pushover(shown.scene(), until=shown.load_factor - 1e-3, certify="none")
    assert again.load_factor[0] == pytest.approx(shown.load_factor, abs=1e-6)


@pytest.mark.exhaustive
def test_an_arch_in_soil_keeps_the_laws_and_says_that_its_curve_depends_on_the_step() -> None:
    """Voussoirs push the soil in and come back on the way; jumps are proved with what led there."""
    bare = bridge(Arch(6.55, 1.428, voussoirs=16), thickness=0.22, width=3.8, cover=0.165,
                  density=17.66, fill=20.0, friction=0.6)  # fmt: skip
    level = 1.428 + 0.22 + 0.165
    soil = passive(bare, level, unit_weight=20.0, coefficient=1.5)
    scene = replace(bare, reactions=soil)
    scene = scene.with_live(Load(points=Road(scene, level).load(at=6.55 / 4, force=1.0).points))
    found = solve(scene, [Rocking()], formulation=vertex_forces)
    path = pushover(scene, certify="last")
    assert path.load_factor[0] == pytest.approx(found.load_factor, rel=1e-6)
    assert path.load_factor[0] > 1.2 * pushover(replace(scene, reactions=())).load_factor[0]
    assert path.halved is not None
    assert any("depends on the step" in note for note in path.notes)
    for shown in path:
        assert_balanced_within_friction(shown)
    assert prove(path).is_proved

"""Paths that start displaced, and contacts with a friction of their own that form on the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest

from cvxlimit import Block, Load, Path, Scene, builtin_scene, code_check, prove, pushover
from cvxlimit.errors import InputError
from cvxlimit.io import read_path
from cvxlimit.masonry import single_block, stack
from linkages import leaning, rocking

PUSH = Load(acceleration=(1, 0, 0))


def quick(scene: Scene | Path, until: float = 0.0, **options: object) -> Path:
    return pushover(scene, until=until, certify="none", **options)  # type: ignore[arg-type]


def tilted(angle: float, b: float = 0.5, h: float = 1.0, heel: float = 0.0) -> Scene:
    """A block of b x h that stands on its right lower edge, turned towards the push."""
    ground = Block.box("ground", (-5, -5, -1), (5, 5, 0))
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    block = Block.box("b", (-b, -0.25, 0), (0, 0.25, h), density=10)
    return Scene([ground, block.moved(turn, (0, 0, heel))], ["ground"], PUSH, friction=0.7)


def test_a_block_that_starts_on_its_edge_is_held_by_the_push(tmp_path: File) -> None:
    angle = np.radians(10.0)
    path = pushover(tilted(angle))
    assert path.initial is None
    assert "starts displaced" in path.notes[0]
    assert path.load_factor[0] == pytest.approx(np.tan(np.arctan(0.5) - angle), abs=1e-8)
    # moved by w at first: what is left of the way is d0
    before = np.hypot(0.25, 0.5) * (np.sin(np.arctan(0.5)) - np.sin(np.arctan(0.5) - angle))
    assert path.d0 == pytest.approx(0.25 - before, abs=1e-7)
    exact = [rocking(0.5, 1.0, before + w) for w in path.w]
    assert path.load_factor == pytest.approx(exact, abs=1e-7)
    bracket = path[0].bracket
    assert bracket is not None
    assert bracket.is_proved
    assert bracket.lower <= exact[0] + 1e-9 <= bracket.upper + 2e-9
    path.save(tmp_path / "path.json")
    assert prove(tmp_path / "path.json").is_proved
    assert read_path(tmp_path / "path.json").initial is None
    assert "displaced" in path.plot().get_suptitle()
    with pytest.raises(InputError, match="starts displaced"):
        code_check(path)


def test_a_scene_that_stands_does_not_start_displaced() -> None:
    """A path whose solution at rest was taken out claims so in vain."""
    path = pushover(builtin_scene("single-block"), step=0.1)
    proof = prove(replace(path, initial=None))
    assert not proof.is_proved
    assert "starts displaced" in str(proof)


@pytest.mark.parametrize("scene", [tilted(0.5), tilted(0.2, heel=0.01)], ids=["beyond", "above"])
def test_what_the_push_does_not_hold_either_is_refused_as_before(scene: Scene) -> None:
    """Turned beyond where its centroid is above its edge, and in the air."""
    with pytest.raises(InputError, match=r"'b' .*touches no other block"):
        pushover(scene)


TURNING = [
    stack(4, (0.5, 0.5, 0.25)),
    single_block((0.4, 0.6, 1.0), live=Load(acceleration=(np.cos(0.4), np.sin(0.4), 0.0))),
]


@pytest.mark.parametrize(
    "scene",
    [*TURNING, pytest.param(builtin_scene("arch"), marks=pytest.mark.exhaustive)],
    ids=["stack", "oblique", "arch"],
)
def test_a_path_begins_again_from_every_configuration_as_a_scene_of_its_own(scene: Scene) -> None:
    path = quick(scene, step=0.1 * scene.contacts.typical_size)
    for shown in path.configurations[1:-1]:
        again = quick(shown.scene(), until=shown.load_factor - 1e-3)
        assert again.load_factor[0] == pytest.approx(shown.load_factor, abs=1e-8)


def two_leaning(between: float) -> Scene:
    blocks = [Block.box("ground", (-5, -5, -1), (5, 5, 0)),
              Block.box("one", (0, 0, 0), (0.2, 0.5, 1.0), 20.0),
              Block.box("other", (0.25, 0, 0), (0.65, 0.5, 1.3), 20.0)]  # fmt: skip
    own = {("ground", "one"): 2.0, ("ground", "other"): 2.0, ("one", "other"): between}
    return Scene(blocks, ["ground"], PUSH, friction=0.0, contact_friction=own)


@pytest.mark.exhaustive
def test_blocks_that_touch_only_later_have_the_friction_of_their_pair(tmp_path: File) -> None:
    scene = two_leaning(0.4)
    with pytest.raises(InputError, match="do not touch"):  # as everywhere but on a path
        _ = scene.contacts
    path = pushover(scene, step=0.02, until=0.05, flow="zero-dilatancy")
    exact = [leaning((0.2, 1.0), (0.4, 1.3), 0.05, w, 0.4) for w in path.w]
    touch = np.array([angle > 0.0 for _, _, angle in exact])
    assert touch.sum() > 3
    # where they have met in the step itself, nothing has slid yet and friction is free
    slides = ~touch | np.roll(touch, 1)
    expected = np.array([alpha for alpha, _, _ in exact])
    assert path.load_factor[slides] == pytest.approx(expected[slides], abs=1e-5)
    smooth = np.array([leaning((0.2, 1.0), (0.4, 1.3), 0.05, w)[0] for w in path.w])
    assert np.abs(path.load_factor - smooth)[slides].max() > 1e-3
    path.save(tmp_path / "path.json")
    assert prove(tmp_path / "path.json").is_proved

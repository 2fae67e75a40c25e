"""Scenes on a table that is tilted slowly in MuJoCo, which shares nothing with the way from rest.

The exported scene settles, then gravity turns: fast up to a share of the load factor reached from
rest, slowly from there on. Its contacts are soft and creep, and what has begun to fall needs time
to be seen: about 2 % is what it can say.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import process_time

import numpy as np

from benchmarks.experiment import Head, Lines, Part, experiment
from benchmarks.scenes import scene_of
from cvxlimit import Incremental, Scene, solve
from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.dynamics.mjcf import mjcf
from cvxlimit.scene.units import G

SCENES = (
    "single-block", "stack", "arch", "arch-on-piers", "barrel-vault", "tuff-wall",
    "ferris-tin-loi-1", "ferris-tin-loi-2", "ferris-tin-loi-3", "irregular-wall-1",
)  # fmt: skip

MOVED = (0.003, 0.03)
"""How far a block has moved over its size where it counts as falling: what contacts give is a tenth
of the first, and one falls on from the second."""

FAST, SHARE = 0.04, 0.8
"""Turns per second of the first stage, in g, and to which share of the number from rest it goes."""

SETTLING, LOOK = 1.0, 0.01
"""Seconds at rest before gravity turns, and between two looks at the blocks."""


@experiment(Part(6))
def tilting(scenes: Sequence[str] = SCENES, rate: float = 0.004) -> Lines:
    """What falls on a table that MuJoCo tilts by so many g a second, beside the way from rest."""
    yield Head("scene", "from rest", *(f"moved {100 * share:g} %" for share in MOVED),
               "over from rest", "CPU s")  # fmt: skip
    for name in scenes:
        scene = scene_of(name)
        reached = solve(scene, method=Incremental(spread=False)).load_factor
        assert reached is not None
        start = process_time()
        fell = tilted(scene, reached, rate)
        found = [fell.get(share) for share in MOVED]
        seconds = process_time() - start
        cells = ["-" if value is None else f"{value:.4f}" for value in found]
        apart = [f"{100 * (value / reached - 1):+.1f} %" for value in found if value is not None]
        yield name, f"{reached:.4f}", *cells, " and ".join(apart), f"{seconds:.0f}"


def tilted(scene: Scene, reached: float, rate: float) -> dict[float, float]:
    """The load factor at which some block has moved by each share of :data:`MOVED`; a scene that
    stands at twice the number from rest has none."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(scene))
    data = mujoco.MjData(model)
    down = model.opt.gravity.copy()
    push = G * np.array(scene.live.acceleration)
    sizes = np.array([np.ptp(scene.blocks[i].vertices, axis=0).max() for i in scene.free])
    of_block = 1 + np.array(scene.free)  # the first body is the world

    def run(seconds: float, load_factor: float) -> FloatArray:
        model.opt.gravity[:] = down + load_factor * push
        mujoco.mj_step(model, data, round(seconds / model.opt.timestep))
        return np.asarray(data.xpos[of_block].copy())

    start, factor = run(SETTLING, 0.0), 0.0
    found: dict[float, float] = {}
    while factor < 2.0 * reached and len(found) < len(MOVED):
        factor += LOOK * (FAST if factor < SHARE * reached else rate)
        moved = np.linalg.norm(run(LOOK, factor) - start, axis=1) / sizes
        for share in MOVED:
            if moved.max() > share:
                found.setdefault(share, factor)
    return found

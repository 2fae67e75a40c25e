"""compas_cra, in an environment of its own, where it does the same job.

It says whether a structure stands under its own weight. Tilted, weight is weight and a push along
x, so it must stand below our load factor and not above it.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.stability.records import Record, Table
from cvxlimit.geometry.blocks import Block
from cvxlimit.masonry import arch, running_bond, stack, wall
from cvxlimit.methods.solving import solve
from cvxlimit.model.formulations import vertex_forces
from cvxlimit.scene import Load, Scene
from cvxlimit.surfaces import Rocking

SHARES = (0.9, 0.99, 1.01, 1.1)
"""Tilts, in shares of our load factor."""

PULL = 1e-3
"""Tension over the weight from which RBE says that the structure falls: 1e-7 to 4e-5 was seen 1 %
below our load factors, 2e-3 to 2e-2 as much above them."""


def _boulder(ratio: float) -> Scene:
    half = ratio / 2.0
    ground = Block.box("ground", (-ratio, -ratio, -ratio), (ratio, ratio, 0))
    boulder = Block.box("boulder", (-half, -half, 0), (half, half, ratio), 1.0)
    pebble = Block.box("pebble", (-0.5, -0.5, ratio), (0.5, 0.5, ratio + 1.0), 1.0)
    push = Load(acceleration=(1, 0, 0))
    return Scene((ground, boulder, pebble), ("ground",), push, friction=0.3)


SCENES: dict[str, Callable[[], Scene]] = {
    "stack": lambda: stack(3, (0.5, 0.5, 0.5), friction=0.6),
    "leaning stack": lambda: stack(4, shift=(0.05, 0.0), friction=0.6),
    "slippery stack": lambda: stack(3, friction=0.2),
    "arch": lambda: arch(10, 0.25),
    "slippery arch": lambda: arch(10, 0.25, friction=0.4),
    "wall": lambda: wall(running_bond(2, 3), friction=0.65),
    "slippery wall": lambda: wall(running_bond(2, 3), friction=0.3),
    "pebble, weights 1e3 apart": lambda: _boulder(10.0),
    "pebble, weights 1e6 apart": lambda: _boulder(100.0),
}


def ask_peer(python: Path, tell: Callable[[str], object]) -> None:
    """Both on all scenes; ``python`` is that of compas_cra's environment."""
    with Table("peer") as table:
        for name, build in SCENES.items():
            if name not in table:
                tell(name)
                table.add(name, _compared(build(), python))


def _compared(scene: Scene, python: Path) -> Record:
    start = time.process_time()
    solution = solve(scene, [Rocking()], formulation=vertex_forces)
    seconds = time.process_time() - start
    factor = solution.load_factor or 0.0
    given = {
        "blocks": [[b.vertices.tolist(), [list(f) for f in b.faces]] for b in scene.blocks],
        "supports": [i for i, b in enumerate(scene.blocks) if b.id in scene.supports],
        "friction": scene.friction,
        "tilts": [share * factor for share in SHARES],
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.json"
        file.write_text(json.dumps(given), encoding="utf-8")
        worker = Path(__file__).with_name("cra_worker.py")
        done = subprocess.run([python, worker, file], capture_output=True, text=True, check=True)
    said = json.loads(done.stdout)
    return {"contacts": solution.contacts, "ours": factor, "gap": solution.gap,
            "tension": said["tension"], "seconds": seconds,
            "seconds_peer": said["seconds"] / len(SHARES)}  # fmt: skip


def agrees(row: Record) -> bool:
    """Whether it stands just below our load factor and falls just above it."""
    pulls = [isinstance(pull, float) and pull > PULL for pull in row["tension"]]
    return pulls == [share > 1.0 for share in SHARES]

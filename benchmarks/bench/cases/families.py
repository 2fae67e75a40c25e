"""Random scenes with seeds: irregular walls, and scenes of the stability bench in closed form."""

from __future__ import annotations

from benchmarks.bench.case import READINGS, SURFACES, Value, case
from benchmarks.stability.families import FAMILIES, sample
from cvxlimit import Scene
from cvxlimit.masonry.walls import random_wall

WALLS = {
    1: "0.951182", 2: "1.976663", 3: "0.540251", 5: "0.257173", 7: "0.334841", 8: "0.244981",
    11: "1.359446", 12: "0.337023", 13: "0.508041", 16: "0.348861",
}  # fmt: skip
"""Seeds, and load factors of the octagon by SciPy's linprog, to six digits."""

for seed, factor in WALLS.items():

    @case(
        f"random-wall-{seed}", f"irregular wall, seed {seed}, pushed in any direction of space",
        Value(factor, "own-lp", "other program", "octagon"), models=(*SURFACES, *READINGS),
        layout="own",
    )  # fmt: skip
    def irregular(seed: int = seed) -> Scene:
        return random_wall(seed)


CLOSED = {
    "wedges": (0, 1), "locked": (0, 1, 2), "grazing": (1,), "degenerate": (0, 1, 2),
}  # fmt: skip
"""Families and seeds of the stability bench whose load factor is known in closed form."""

for family, seeds in CLOSED.items():
    for seed in seeds:
        known = sample(family, seed)
        assert isinstance(known.truth, float)

        @case(
            f"{family}-{seed}", f"{FAMILIES[family].what}: {known.knob}",
            Value(f"{known.truth:.7g}", "statics"), layout="own",
        )  # fmt: skip
        def stability(family: str = family, seed: int = seed) -> Scene:
            return sample(family, seed).scene

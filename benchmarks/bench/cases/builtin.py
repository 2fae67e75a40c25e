"""The package's built-in scenes that stand in no other script here."""

from __future__ import annotations

from benchmarks.bench.case import PLANE, READINGS, SURFACES, Quantity, Value, case
from cvxlimit import Scene, builtin_scene
from cvxlimit.masonry import BUILTIN

VALUES = {
    "single-block": (Value("0.4", "statics"), Value("0.4", "own-lp", "other program", "octagon")),
    "stack": (Value("0.4", "statics"),),
    "barrel-vault": (Value("0.157332", "own-cone", "other program"),),
    "dome": (Value("0.492913", "own-cone", "other program"),),
    "arch": (Value("0.149350168", "own-lp", "other program", "octagon"),),
}

PLANAR = ("single-block", "stack", "arch", "arch-on-piers", "flying-buttress")

OWN_LP = {
    "facade": "0.244124", "house-corner": "0.203887", "arch-on-piers": "0.105262",
    "flying-buttress": "35.4938",
}  # fmt: skip
"""Load factors of the octagon by SciPy's linprog, to six digits; it reads
rectangular contacts only."""


def values(name: str) -> tuple[Value, ...]:
    """What is known from elsewhere."""
    own = OWN_LP.get(name)
    more = (Value(own, "own-lp", "other program", "octagon"),) if own else ()
    return (*VALUES.get(name, ()), *more)


def models(name: str) -> tuple[str, ...]:
    """One reading on the dome, whose branching takes minutes."""
    if name in PLANAR:
        return PLANE
    return (*SURFACES, *(READINGS[:1] if name == "dome" else READINGS))


for name in (*VALUES, *OWN_LP):

    @case(
        f"builtin-{name}", BUILTIN[name].description, *values(name),
        models=models(name), layout="own",
        quantity=Quantity("thrust", "kN") if name == "flying-buttress" else None,
    )  # fmt: skip
    def built(name: str = name) -> Scene:
        return builtin_scene(name)

"""Walls and panels: Ferris & Tin-Loi, the paper's specimens, Orduña & Lourenço, two leaves."""

from __future__ import annotations

from benchmarks.bench.case import PLANE, READINGS, SURFACES, Value, case
from cvxlimit import Block, Load, Scene, builtin_scene
from cvxlimit.masonry import panel, running_bond, wall

WALL = (*PLANE, "zero-dilatancy")
SPACE = (*SURFACES, *READINGS, "zero-dilatancy")


def dilatancy(text: str, end: str) -> Value:
    """A value without dilatancy, which is one of many."""
    return Value(
        text, "prototype", "other program", "zero-dilatancy", "model form",
        f"Friction without dilatancy has many solutions; this is the {end} that was found.",
    )  # fmt: skip


@case(
    "ferris-tin-loi-1", "Ferris & Tin-Loi 2001, wall 1: 6 courses, pushed in its plane",
    Value("0.642859", "ferris-tin-loi-2001", "other program"),
    Value("0.643", "hybridfem", "other program"),
    Value("0.64", "mosek-optim", "other program"),
    dilatancy("0.638982", "lowest"), dilatancy("0.642859", "highest"), models=WALL,
)  # fmt: skip
def ferris_tin_loi_1() -> Scene:
    return builtin_scene("ferris-tin-loi-1")


@case(
    "ferris-tin-loi-2", "Ferris & Tin-Loi 2001, wall 2: 10 courses, pushed in its plane",
    Value("0.579999", "ferris-tin-loi-2001", "other program"),
    Value("0.564", "hybridfem", "other program", "zero-dilatancy", "model form",
          "Friction without dilatancy has many solutions, of which a scheme finds one."),
    dilatancy("0.557416", "lowest"), dilatancy("0.579606", "highest"), models=WALL,
)  # fmt: skip
def ferris_tin_loi_2() -> Scene:
    return builtin_scene("ferris-tin-loi-2")


@case(
    "ferris-tin-loi-3", "Ferris & Tin-Loi 2001, wall 3: a window, pushed in its plane",
    Value("0.403694", "ferris-tin-loi-2001", "other program"),
    dilatancy("0.355817", "lowest"), dilatancy("0.388684", "highest"), models=WALL,
)  # fmt: skip
def ferris_tin_loi_3() -> Scene:
    return builtin_scene("ferris-tin-loi-3")


@case(
    "tuff-wall", "the paper's tuff wall on a tilting table, held at one end",
    Value("0.450034", "prototype", "other program", "octagon"),
    Value("0.423056", "prototype", "other program"),
    Value("0.423083", "prototype", "other program", "parabolic"),
    models=SPACE,
    note="The measured multiplier is in a table that the stored text of the paper lacks.",
)  # fmt: skip
def tuff_wall() -> Scene:
    return builtin_scene("tuff-wall")


LAYOUT = (
    "The paper does not give the layout; of fronts, returns and courses that its bricks allow, "
    "this one has its counts and first factor most nearly."
)
INFERRED = "The layout of the specimen is not published; counts and first factor are near."
MOVES = "The paper's iteration has no certificate and depends on which of many forces are found."
SCATTER = "One test each; the nearest proved bracket is that of the safe reading."


def specimen(test: str, first: str, last: str, counted: str) -> tuple[Value, ...]:
    """Measured, first and last iterate of the paper, and the linear program of the layout."""
    return (
        Value(counted, "prototype", "other program", "octagon"),
        Value(first, "portioli-2013", "other program", "octagon", "input not published", INFERRED),
        Value(last, "portioli-2013", "other program", "paper", "model form", MOVES),
        Value(test, "restrepo-velez-2014", "test", "independent", "scatter of tests", SCATTER),
    )


@case("s12-panel", "panel S12 of Restrepo Vélez & Magenes: one return",
      *specimen("0.129", "0.186", "0.137", "0.184581"),
      Value("0.181935", "prototype", "other program"),
      models=SPACE, layout="inferred", note=LAYOUT)  # fmt: skip
def s12_panel() -> Scene:
    return builtin_scene("s12-panel")


@case("s10-panel", "panel S10 of Restrepo Vélez & Magenes: two returns",
      *specimen("0.213", "0.262", "0.215", "0.264729"),
      Value("0.259313", "prototype", "other program"),
      models=SPACE, layout="inferred", note=LAYOUT)  # fmt: skip
def s10_panel() -> Scene:
    return builtin_scene("s10-panel")


CLASS = "A panel like the specimen, with another front and return."
SAME = ("octagon", "conic", "parabolic", "vertex-forces", "vertex-octagon")


@case("s12-class", "panel like S12: front 0.80 m, return 0.52 m, 19 courses",
      Value("0.178313", "prototype", "other program", "octagon"),
      Value("0.175819", "prototype", "other program"),
      models=(*SAME, "independent"), layout="own", note=CLASS
)  # fmt: skip
def s12_class() -> Scene:
    return panel(0.80, 19, left_return=0.52)


@case("s10-class", "panel like S10: front 0.88 m, returns 0.36 m, 34 courses",
      Value("0.165318", "prototype", "other program", "octagon"),
      Value("0.165318", "prototype", "other program"),
      models=SAME, layout="own", note=CLASS)  # fmt: skip
def s10_class() -> Scene:
    return panel(0.88, 34, left_return=0.36, right_return=0.36)


@case(
    "orduna-lourenco-wall", "wall of Orduña & Lourenço, held at one edge, pushed out of its plane",
    models=SPACE, layout="inferred",
    note="Blocks, friction and the counts (46 blocks, 111 contacts) are in Portioli et al. (2013); "
    "4 units by 10 courses have these with the ground counted as a block and without the joints at "
    "the held edge. Their table of load factors is missing in the stored text: no value is given.",
)  # fmt: skip
def orduna_lourenco_wall() -> Scene:
    """Blocks of 0.21 x 0.081 x 0.07 m, 20 kN/m3; unit forces on every block: the unit is kN."""
    bare = wall(running_bond(4, 10), unit=(0.21, 0.081, 0.07), friction=0.7,
                side_supports=("start",))  # fmt: skip
    forces = {bare.blocks[i].id: (0.0, 1.0, 0.0, 0.0, 0.0, 0.0) for i in bare.free}
    return bare.with_live(Load(forces=forces))


@case(
    "two-leaves-apart", "two leaves of 0.25 x 3.9 m without headers: t / h of one leaf",
    Value(f"{0.25 / 3.9:.9f}", "statics"), layout="inferred",
    note="Figure 11 of Portioli (2020) is not readable as numbers. Leaves of 30 courses, 2 m long "
    "in one piece, one behind the other and without friction between them, pushed across: they "
    "turn about their toes side by side.",
)  # fmt: skip
def two_leaves_apart() -> Scene:
    ground = Block.box("ground", (-1, -1, -1), (3, 2, 0))
    step = 3.9 / 30
    leaves = [
        Block.box(f"{leaf}{k + 1}", (0, y, k * step), (2, y + 0.25, (k + 1) * step), 18.0)
        for leaf, y in (("back", 0.0), ("front", 0.25)) for k in range(30)
    ]  # fmt: skip
    between = {(f"back{k + 1}", f"front{k + 1}"): 0.0 for k in range(30)}
    push = Load(acceleration=(0, 1, 0))
    return Scene((ground, *leaves), ("ground",), push, friction=0.58, contact_friction=between)

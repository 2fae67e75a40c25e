"""Arches, least thicknesses, domes, bridges, and mortared arches that no-tension must not reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.bench.case import Quantity, Value, case
from benchmarks.experiments.dome import crowned
from cvxlimit import Load, PointForce, Scene
from cvxlimit.masonry import arch

RATIO = "least thickness over mean radius"
CENTRE_LINE = (
    "the closed form puts the weight on the centre line of the ring, the scene at the centroids of "
    "straight-sided voussoirs"
)


def between(
    name: str, title: str, *values: Value, build: Callable[[float], Scene],
    falls: float, stands: float, what: str = RATIO, note: str = "",
) -> None:  # fmt: skip
    """A case whose answer lies between two numbers, of which ``build`` makes a scene each."""
    quantity = Quantity(what, parameter={"falls": falls, "stands": stands})

    @case(name, title, *values, quantity=quantity, note=note)
    def scenes() -> dict[str, Scene]:
        return {"falls": build(falls), "stands": build(stands)}


def crown(voussoirs: int, ratio: float, friction: float = 10.0) -> Scene:
    """A semicircle with a load on its two crown voussoirs, which drives the fall of a thin one."""
    down = (0.0, 0.0, -0.5, 0.0, 0.0, 0.0)
    middle = (voussoirs // 2, voussoirs // 2 + 1)
    live = Load(forces={f"v{k}": down for k in middle})
    return arch(voussoirs, ratio, friction=friction, live=live)


HINGES = Value("0.107426", "cocchetti-rizzi-2020", discrepancy="model form",
               why=f"Hinges form at 40 joints only, and {CENTRE_LINE}.")  # fmt: skip
LEAST = Value("0.1074", "cocchetti-rizzi-2020")

between(
    "semicircle-thickness-40", "semicircle of 40 voussoirs, own weight: least thickness",
    Value("0.107432", "prototype", "other program"), LEAST, HINGES,
    build=partial(crown, 40), falls=0.1074315, stands=0.1074325,
)  # fmt: skip

between(
    "semicircle-thickness-100", "semicircle of 100 voussoirs, own weight: least thickness",
    Value("0.107456", "prototype", "other program"),
    Value("0.1075", "makris-alexakis-2013"),
    Value("0.107426", "cocchetti-rizzi-2020", discrepancy="model form",
          why=f"For {CENTRE_LINE}."),
    Value("0.1095", "makris-alexakis-2013", discrepancy="model form",
          why="The value is for vertical cuts; the scene's joints are radial."),
    Value("0.1117", "makris-alexakis-2013", discrepancy="model form",
          why="The value is the thickness that holds a catenary, which is safe and not the least."),
    build=partial(crown, 100), falls=0.1074555, stands=0.1074565,
)  # fmt: skip


def centred(voussoirs: int, ratio: float) -> Scene:
    """The same with the weight of every voussoir on the centre line, where closed forms put it."""
    scene = crown(voussoirs, ratio)
    angles = np.pi * (1.0 - (np.arange(voussoirs) + 0.5) / voussoirs)
    weights = [
        PointForce(
            f"v{k + 1}", (float(np.cos(a)), 0.15, float(np.sin(a))), (0, 0, -1.0 / voussoirs)
        )
        for k, a in enumerate(angles)
    ]
    return replace(scene, dead=Load(points=weights))


between(
    "semicircle-centre-line", "semicircle of 200 voussoirs with the weight on its centre line",
    LEAST, build=partial(centred, 200), falls=0.10738, stands=0.10744,
)  # fmt: skip

between(
    "semicircle-transition", "semicircle at the friction where sliding begins: least thickness",
    LEAST, HINGES,
    build=partial(crown, 40, friction=0.3962), falls=0.1074315, stands=0.1074325,
    note="Friction 0.3962, just above the closed form's transition at 0.395832.",
)  # fmt: skip

between(
    "semicircle-least-friction", "semicircle of 40 voussoirs, t / R = 0.3: least friction",
    Value("0.309215", "cocchetti-rizzi-2020"), what="least friction",
    build=partial(crown, 40, 0.3), falls=0.3085, stands=0.3095,
)  # fmt: skip

RANGE = "{} end of the literature's range: the lune is cut and weighed in other ways."

between(
    "dome-thickness", "hemispherical dome of 12 x 12 blocks, own weight: least thickness",
    Value("0.042", "heyman-1967", "other program"),
    Value("0.041", "heyman-1967", "other program", discrepancy="model form",
          why=RANGE.format("Lower")),
    Value("0.043", "heyman-1967", "other program", discrepancy="model form",
          why=RANGE.format("Upper")),
    build=partial(crowned, 12, 12, 4.0), falls=0.04187, stands=0.04207,
)  # fmt: skip


OPPENHEIM = Quantity("horizontal acceleration over gravity")


def oppenheim(voussoirs: int) -> Scene:
    """Embrace 157.5 degrees, thickness 0.15 of the mean radius, pushed sideways."""
    return arch(voussoirs, 0.15, embrace=157.5, friction=10.0)


@case("oppenheim-7", "Oppenheim's arch of 7 voussoirs, pushed sideways",
      Value("0.3736117", "prototype", "other program"), quantity=OPPENHEIM,
      note="Geometry of Oppenheim (1992); his value could not be opened and is left out."
)  # fmt: skip
def oppenheim_7() -> Scene:
    return oppenheim(7)


@case("oppenheim-28", "Oppenheim's arch cut into 28 voussoirs",
      Value("0.354868", "prototype", "other program"), quantity=OPPENHEIM
)  # fmt: skip
def oppenheim_28() -> Scene:
    return oppenheim(28)


@case("oppenheim-100", "Oppenheim's arch cut into 100 voussoirs",
      Value("0.353503", "prototype", "other program"), quantity=OPPENHEIM
)  # fmt: skip
def oppenheim_100() -> Scene:
    return oppenheim(100)


def loaded(scene: Scene, joint: int, depth: float, thickness: float) -> Scene:
    """A vertical force of 1 at joint ``joint`` from the left (0 is the springing), on the voussoir
    after it.

    ``depth`` is its place on the joint: 1 at the extrados, 0.5 at mid depth, 0 at the intrados.
    """
    name = f"v{joint + 1}"
    ring = next(b for b in scene.blocks if b.id == name).vertices[:4]
    inner, outer = ring[[0, 3]].mean(axis=0), ring[[1, 2]].mean(axis=0)
    at = inner + depth * (outer - inner)
    assert abs(np.linalg.norm(outer - inner) - thickness) < 1e-9 * thickness
    return scene.with_live(Load(points=[PointForce(name, tuple(at.tolist()), (0, 0, -1))]))


def stockdale(depth: float) -> Scene:
    """27 voussoirs, intrados 1.806 m, t = 0.1661 of that, 0.25 m deep, 1530 kg/m3, g = 9.81."""
    inner, thickness = 1.806, 0.1661 * 1.806
    mean = inner + thickness / 2
    ring = arch(27, thickness / mean, mean_radius=mean, width=0.25,
                density=1.530 * 9.81, friction=10.0)  # fmt: skip
    return loaded(ring, 8, depth, thickness)


FORCE = Quantity("force", "kN")
SECTORS = "The published value is for circular sectors, the scene has straight-sided voussoirs."


@case(
    "stockdale-extrados", "arch of 27 voussoirs, force on the extrados of joint 8",
    Value("2.751", "stockdale-2018", "other program", discrepancy="model form", why=SECTORS),
    Value("2.756", "stockdale-2018", "other program", discrepancy="model form", why=SECTORS),
    Value("2.746597", "prototype", "other program"), quantity=FORCE,
)  # fmt: skip
def stockdale_extrados() -> Scene:
    return stockdale(1.0)


@case("stockdale-mid-depth", "the same arch, force at mid depth of joint 8",
      Value("2.323", "prototype", "other program"), quantity=FORCE)  # fmt: skip
def stockdale_mid_depth() -> Scene:
    return stockdale(0.5)


@case("stockdale-intrados", "the same arch, force on the intrados of joint 8",
      Value("1.9431", "prototype", "other program"), quantity=FORCE)  # fmt: skip
def stockdale_intrados() -> Scene:
    return stockdale(0.0)


def segment(
    span: float, rise: float, thickness: float, width: float, voussoirs: int, density: float
) -> Scene:
    """A circular segment of that clear span and rise of its intrados, friction high."""
    inner = (span**2 / 4 + rise**2) / (2 * rise)
    mean, half = inner + thickness / 2, np.arcsin(span / 2 / inner)
    return arch(voussoirs, thickness / mean, mean_radius=mean, embrace=float(np.degrees(2 * half)),
                width=width, density=density, friction=10.0)  # fmt: skip


def prestwood(with_fill: bool) -> Scene:
    """Span 6.55 m, rise 1.428 m, ring 0.22 m, width 3.8 m, 40 voussoirs; load at a quarter."""
    ring = segment(6.55, 1.428, 0.22, 3.8, 40, 20.0)
    scene = loaded(ring, 10, 1.0, 0.22)
    if not with_fill:
        return scene
    tops = {b.id: b.vertices for b in ring.blocks if b.id.startswith("v")}
    level = max(v[:, 2].max() for v in tops.values()) + 0.165
    soil = []
    for name, corners in tops.items():
        left, right = corners[[1, 2]].mean(axis=0), corners[[5, 6]].mean(axis=0)
        wide, high = right[0] - left[0], level - (left[2] + right[2]) / 2
        at = ((left + right) / 2).tolist()
        soil.append(PointForce(name, tuple(at), (0.0, 0.0, float(-20.0 * 3.8 * wide * high))))
    return replace(scene, dead=Load(gravity=(0, 0, -1), points=soil))


FILL = "The model has no {}, which carry most of the load of this bridge."
TEST_KN = Quantity("line load at a quarter of the span", "kN")


@case(
    "prestwood-ring", "Prestwood bridge, the ring alone",
    Value("228", "page-1987", "test", discrepancy="missing physics",
          why=FILL.format("fill: its weight, its passive pressure and its spreading of the load")),
    quantity=TEST_KN, layout="inferred",
    note="Ring undistorted, of 20 kN/m3, 40 voussoirs; the real one was distorted.",
)  # fmt: skip
def prestwood_ring() -> Scene:
    return prestwood(False)


@case(
    "prestwood-fill", "Prestwood bridge, the ring with the weight of its fill",
    Value("228", "page-1987", "test", discrepancy="missing physics",
          why=FILL.format("passive pressure and spreading of the load in the fill")),
    Value("220", "simoncello-2020", "other program", discrepancy="missing physics",
          why=FILL.format("passive pressure and spreading of the load in the fill")),
    Value("245", "simoncello-2020", "other program", discrepancy="missing physics",
          why=FILL.format("passive pressure and spreading of the load in the fill")),
    quantity=TEST_KN, layout="inferred",
    note="Depth of fill at the crown, 0.165 m, and both densities, 20 kN/m3, are not from the "
    "source; fill acts as weight on the extrados.",
)  # fmt: skip
def prestwood_fill() -> Scene:
    return prestwood(True)


MORTAR = "The arch was laid in mortar, whose tension the model does not have: it must stay below."


@case(
    "vault-strip", "strip of a barrel vault, force at 0.556 m from the abutment",
    Value("0.39", "carozzi-2018", "test", discrepancy="missing physics", why=MORTAR),
    Value("0.261", "bertolesi-2018", "other program", discrepancy="input not published",
          why="The weight of the strip is not published; 18 kN/m3 was taken."),
    quantity=FORCE, layout="inferred",
    note="Span 3.30 m and rise 0.83 m taken as the intrados', 40 voussoirs, 18 kN/m3.",
)  # fmt: skip
def vault_strip() -> Scene:
    ring = segment(3.30, 0.83, 0.06, 0.30, 40, 18.0)
    joints = [ring.blocks[k + 1].vertices[4:, 0].mean() for k in range(40)]
    left = -3.30 / 2
    joint = int(np.argmin([abs(x - left - 0.556) for x in joints])) + 1
    return loaded(ring, joint, 1.0, 0.06)


@case(
    "arch-oliveira", "mortared arch of 59 courses, load at a quarter",
    Value("1.43", "oliveira-2010", "test", discrepancy="missing physics", why=MORTAR),
    Value("1.92", "oliveira-2010", "test", discrepancy="missing physics", why=MORTAR),
    quantity=FORCE, layout="inferred",
    note="Radius 0.75 m taken as the intrados', weight 18 kN/m3, joint 15 of 59.",
)  # fmt: skip
def arch_oliveira() -> Scene:
    ring = arch(59, 0.05 / 0.775, mean_radius=0.775, embrace=156.0, width=0.45,
                density=18.0, friction=10.0)  # fmt: skip
    return loaded(ring, 15, 1.0, 0.05)


@case(
    "arch-borri", "mortared semicircle of span 2 m, load at midspan",
    Value("0.7", "borri-2011", "test", discrepancy="missing physics", why=MORTAR),
    quantity=FORCE, layout="inferred",
    note="Span 2 m taken as the intrados', 40 voussoirs, 1807 kg/m3 with g = 9.81.",
)  # fmt: skip
def arch_borri() -> Scene:
    ring = arch(40, 0.125 / 1.0625, mean_radius=1.0625, width=0.25,
                density=1.807 * 9.81, friction=10.0)  # fmt: skip
    return loaded(ring, 20, 1.0, 0.125)

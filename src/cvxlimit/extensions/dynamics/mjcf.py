"""Scenes as MJCF, the model files of MuJoCo, in metres, newtons, kilograms and seconds."""

from __future__ import annotations

from itertools import product
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import positive
from cvxlimit.base.lines import one_line
from cvxlimit.errors import ModelError
from cvxlimit.extensions.dynamics.convex import convex_pieces
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.mesh import second_moments
from cvxlimit.scene import METRES, Scene
from cvxlimit.scene.units import KILONEWTONS, G

IMPEDANCE = 0.99
"""Share of a contact's acceleration that its own stiffness decides; MuJoCo lets it vary with the
penetration between two values, over a length that would not scale with a structure."""

FRICTION_FIRST = 100.0
"""How many times stiffer contacts are along a joint than across it (``impratio``), so that friction
below its limit does not creep."""


def metres(scene: Scene) -> float:
    """How many metres the scene's unit of length is."""
    if scene.units.length not in METRES or scene.units.force not in KILONEWTONS:
        raise ModelError(
            f"motion in time needs units that can be converted (lengths {', '.join(METRES)}; "
            f"forces {', '.join(KILONEWTONS)}), got {scene.units.length!r} and "
            f"{scene.units.force!r}"
        )
    return METRES[scene.units.length]


def refuse(scene: Scene) -> None:
    """Refuse scenes with what the engine's dry, rigid contacts and turning blocks do not have."""
    has = ""
    for name, none in (
        ("cohesion", 0.0), ("tensile_strength", 0.0), ("compressive_strength", np.inf)
    ):  # fmt: skip
        given = {getattr(scene, name), *getattr(scene, f"contact_{name}").values()} - {none}
        has = has or (f"{name.replace('_', ' ')} {min(given):g}" if given else "")
    way = "" if has else ", or give its force as a point load"
    for some, what in (
        (scene.ties, "ties"), (scene.reactions, "reactions"),
        (scene.dead.pressures, "pressures in the dead load"),
        (scene.dead.growing, "inertia that grows with height in the dead load"),
    ):  # fmt: skip
        has = has or (what if some else "")
    if has:
        raise ModelError(
            f"scene {scene.name!r} has {has}: motion in time knows dry friction, own weight and "
            f"forces that keep their direction; leave it out{way}"
        )
    for block in (scene.blocks[i] for i in scene.free):
        if not block.weight > 0.0:
            raise ModelError(f"block {block.id!r} has no weight, and so no mass: give it a density")


def written(scene: Scene, solution: object) -> str:
    """The scene alone, as :func:`cvxlimit.io.export` asks for it."""
    return mjcf(scene)


def mjcf(scene: Scene, g: float = G) -> str:
    """The scene as MJCF, to run in MuJoCo or to go on with.

    Blocks are bodies in the order of the scene, at their centroids, with their exact masses and
    inertias; those that are not convex are made of several convex pieces. Supports are bodies that
    do not move. The dead load is ``gravity``, and constant forces of actuators at points of blocks,
    which keep their direction. Friction of pairs of blocks with an exception is that of ``pair``
    elements. The live load is left out: a ground acceleration takes its place.

    Parameters
    ----------
    scene : Scene
    g : float
        Acceleration of gravity, m/s2.

    Raises
    ------
    ModelError
        For units that cannot be converted; cohesion, strengths, ties, reactions and pressures; free
        blocks without weight.
    GeometryError
        For a block with too many notches.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> mjcf(builtin_scene("single-block")).count("<freejoint")
    1
    """
    length, newtons = metres(scene), 1e3 * KILONEWTONS[scene.units.force]
    g = positive(g, "g")
    refuse(scene)
    # What holds of all: gravity, the engine's settings, friction and stiffness of contacts.
    root = Element("mujoco", model=one_line(scene.name))
    SubElement(root, "compiler", angle="radian", balanceinertia="false")
    common = _sum(scene.dead.gravity, scene.dead.acceleration)
    option = SubElement(
        root, "option", timestep="0.0005", gravity=_text(g * common), cone="elliptic",
        impratio=_text(FRICTION_FIRST), iterations="200", tolerance="1e-12",
    )  # fmt: skip
    SubElement(option, "flag", multiccd="enable")
    default = SubElement(root, "default")
    soft: Any = {"solref": "0.002 1", "solimp": _text([IMPEDANCE, IMPEDANCE, 1e-3])}
    friction = _text([scene.friction, 0.0, 0.0])
    SubElement(default, "geom", condim="3", friction=friction, **soft)
    # Blocks: bodies with masses, and shapes that fill them.
    assets, world = SubElement(root, "asset"), SubElement(root, "worldbody")
    SubElement(world, "site", name="world")
    bodies, shapes = dict[str, Element](), dict[str, list[str]]()
    free = {scene.blocks[i].id for i in scene.free}
    for number, block in enumerate(scene.blocks):
        mass = block.weight * newtons / g if block.id in free else None
        body = _body(world, f"{number} {one_line(block.id)}", block, mass, length)
        pieces = {f"{number}.{part}": x for part, x in enumerate(convex_pieces(block))}
        for name, corners in pieces.items():
            _shape(body, assets, name, block, length * (corners - block.centroid))
        bodies[block.id], shapes[block.id] = body, [*pieces]
    # Where two blocks have friction of their own, a pair of shapes takes the place of the default.
    contact = SubElement(root, "contact")
    for (a, b), value in scene.contact_friction.items():
        friction = _text([value, value, 0.0, 0.0, 0.0])
        for one, other in product(shapes[a], shapes[b]):
            SubElement(contact, "pair", geom1=one, geom2=other, condim="3", friction=friction,
                       **soft)  # fmt: skip
    _push(SubElement(root, "actuator"), bodies, scene, length, newtons)
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def _body(
    world: Element, name: str, block: Block, mass: float | None, length: float
) -> Element:  # fmt: skip
    """A block's body, with its ``mass`` in kg if it is free to move."""
    body = SubElement(world, "body", name=name, pos=_text(length * block.centroid))
    if mass is not None:
        SubElement(body, "freejoint")
        SubElement(body, "inertial", pos="0 0 0", mass=_text(mass),
                   fullinertia=_text(_inertia(block, mass, length)))  # fmt: skip
    return body


def _push(
    actuators: Element, bodies: dict[str, Element], scene: Scene, length: float, newtons: float
) -> None:
    """Forces that keep their direction: what an actuator without control adds at a site."""
    for number, (block, at, force) in enumerate(_forces(scene)):
        site = f"force {number}"
        place = _text(length * (at - block.centroid))
        SubElement(bodies[block.id], "site", name=site, pos=place)
        gear = newtons * force * np.array([1.0, 1.0, 1.0, length, length, length])
        SubElement(actuators, "general", site=site, refsite="world", gear=_text(gear),
                   biastype="affine", biasprm="1 0 0", gainprm="0")  # fmt: skip


def _text(values: float | list[float] | FloatArray) -> str:
    return " ".join(repr(float(x) + 0.0) for x in np.atleast_1d(np.asarray(values, dtype=float)))


def _sum(*parts: tuple[float, ...] | None) -> FloatArray:
    return np.sum([np.zeros(3), *(np.array(x) for x in parts if x is not None)], axis=0)


def _inertia(block: Block, mass: float, length: float) -> FloatArray:
    """Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centroid, in kg m2."""
    moments = second_moments(block.vertices - block.centroid, block.faces) / block.volume
    tensor = mass * length**2 * (np.trace(moments) * np.eye(3) - moments)
    return tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]


def _shape(body: Element, assets: Element, name: str, block: Block, corners: FloatArray) -> None:
    """One convex shape, with corners (k, 3) in metres about the block's centroid."""
    if block.bounds is not None:
        SubElement(body, "geom", name=name, type="box", size=_text(corners.max(axis=0)))
        return
    SubElement(assets, "mesh", name=name, vertex=_text(corners.ravel()), inertia="convex")
    SubElement(body, "geom", name=name, type="mesh", mesh=name)


def _forces(scene: Scene) -> list[tuple[Block, FloatArray, FloatArray]]:
    """Block, point and force with moment (6,) of all of the dead load that is no common gravity."""
    dead, of = scene.dead, {block.id: block for block in scene.blocks}
    found = [
        (of[p.block], np.array(p.at), np.array([*p.force, 0.0, 0.0, 0.0])) for p in dead.points
    ]
    for name, times in dead.weights.items():
        own = np.array([*times, 0.0, 0.0, 0.0])
        found.append((of[name], of[name].centroid, of[name].weight * own))
    found += [(of[name], of[name].centroid, np.array(force)) for name, force in dead.forces.items()]
    return found

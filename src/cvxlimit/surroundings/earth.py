"""Coulomb's active earth pressure: soil that slides down behind a wall, and rubs on it."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import finite_vector
from cvxlimit.errors import InputError
from cvxlimit.scene.loads import Load, PointForce
from cvxlimit.scene.pressures import Pressure
from cvxlimit.scene.scene import Scene
from cvxlimit.surroundings.bare_faces import Face, looking, upwards, written
from cvxlimit.surroundings.reached import Layers, check_level, layered, layers_of, on_face


def coulomb_coefficient(
    phi: float, delta: float = 0.0, beta: float = 0.0, batter: float = 0.0
) -> float:
    """Returns Coulomb's active coefficient K: the push is K gamma H^2 / 2 on a wall of height H.

    The push is inclined by ``delta`` to the normal of the wall's back, downwards on the wall. With
    t the batter,

        K = (cos(phi - t) / (cos t (1 + root)))^2 / cos(delta + t),
        root^2 = sin(phi + delta) sin(phi - beta) / (cos(delta + t) cos(t - beta)).

    Parameters
    ----------
    phi, delta : float
        Angles (degrees) of friction within the soil, and between soil and wall.
    beta : float
        Slope (degrees) of the soil's surface, up from the wall; at most ``phi``.
    batter : float
        Of the wall's back from upright (degrees), positive if soil rests on it.

    Raises
    ------
    InputError
        For angles for which there is no such wedge of soil.

    Example
    -------
    >>> round(coulomb_coefficient(30.0), 4)  # Rankine's: tan(30 degrees)^2
    0.3333
    >>> round(coulomb_coefficient(30.0, 20.0, 10.0, 5.0), 4)
    0.3857
    """
    angles = finite_vector([phi, delta, beta, batter], 4, "phi, delta, beta and batter").tolist()
    phi, delta, beta, batter = angles
    is_friction = 0.0 < phi < 90.0 and 0.0 <= delta <= phi
    is_upright = abs(batter) < 80.0 and delta + batter < 90.0
    if not (is_friction and is_upright and -90.0 < beta <= phi):
        raise InputError(
            "Coulomb's wedge needs 0 < phi < 90, delta from 0 to phi, beta at most phi, batter "
            f"below 80 degrees; got phi {phi:g}, delta {delta:g}, beta {beta:g}, batter {batter:g}"
        )
    p, d, b, t = np.radians(angles)
    root = np.sqrt(np.sin(p + d) * np.sin(p - b) / (np.cos(d + t) * np.cos(t - b)))
    return float((np.cos(p - t) / (np.cos(t) * (1.0 + root))) ** 2 / np.cos(d + t))


def coulomb_pressure(
    scene: Scene,
    level: float,
    unit_weight: float,
    direction: ArrayLike,
    *,
    phi: float,
    delta: float = 0.0,
    beta: float = 0.0,
    surcharge: float = 0.0,
    blocks: Collection[str] | None = None,
    water: float | None = None,
    submerged: float | None = None,
) -> Load:
    """Active earth pressure with friction on the wall, on faces with any batter, as a load.

    On each face that :func:`cvxlimit.earth_pressure` would load it presses with Coulomb's
    coefficient for the batter of that face, and rubs downwards along it. Treads of a stepped back
    look up: soil on them is :func:`cvxlimit.fill`.

    Parameters
    ----------
    scene, level, unit_weight, direction, surcharge, blocks, water, submerged
        As for :func:`cvxlimit.earth_pressure`; ``level`` is where the soil meets the wall. A
        surcharge needs a level surface.
    phi, delta, beta : float
        As for :func:`coulomb_coefficient`.

    Returns
    -------
    Load
        Pressures, and forces along faces: ``replace(GRAVITY, pressures=..., points=...)`` as a
        part of the dead load.

    Raises
    ------
    InputError
        If a number, an angle or a block is wrong, or the soil reaches no face.

    Example
    -------
    >>> from cvxlimit.masonry import stack
    >>> wall = stack(1, size=(0.8, 1.0, 2.0))
    >>> earth = coulomb_pressure(wall, 2.0, 18.0, (-1, 0, 0), phi=30.0, delta=20.0)
    >>> push, lift = earth.on(wall.blocks)[:, [0, 2]].sum(axis=0)
    >>> round(float(np.hypot(push, lift)), 4)  # K 18 x 2^2 / 2
    10.7033
    >>> round(float(np.degrees(np.arctan2(-lift, push))), 4)
    20.0
    """
    if surcharge and beta:
        raise InputError(f"a surcharge needs a level surface, got beta {beta:g}: leave one out")
    layers = layers_of(level, unit_weight, surcharge, water, submerged)
    up, faces = upwards(scene), looking(scene, direction, blocks)
    check_level(level, faces, up, f"along {written(direction)}")
    pressures, points = list[Pressure](), list[PointForce]()
    for face in faces:
        rise = float(face.normal @ up)
        slope = np.sqrt(1.0 - rise**2)  # the face's height per length along it
        k = coulomb_coefficient(phi, delta, beta, float(np.degrees(np.arcsin(rise)))) * slope
        # The part of the push across the face is a pressure, the part along it a point force.
        across = float(k * np.cos(np.radians(delta)))
        along = float(k * np.sin(np.radians(delta)))
        pressures += on_face(face, layers, across, up)
        size, centre = _weight_on(face, layers, up)
        if along * size > 0.0:
            down = (rise * face.normal - up) / slope
            force = along * size * down
            points.append(PointForce(face.block.id, centre.tolist(), (force + 0.0).tolist()))
    return Load(pressures=pressures, points=points)


def _weight_on(face: Face, layers: Layers, up: FloatArray) -> tuple[float, FloatArray]:
    """Returns the layers' vertical pressure summed over a face, a force, and its centre (3,)."""
    total, moment = 0.0, np.zeros(3)
    for part, surface, weight, first in layered(face, layers, up):
        places, areas, depth = part.below(surface, up)
        sizes = (first + weight * depth) * (areas @ face.normal)
        total += float(sizes.sum())
        moment = moment + sizes @ places
    return total, moment / total if total > 0.0 else moment

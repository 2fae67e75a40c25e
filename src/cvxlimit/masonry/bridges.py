"""Arch bridges in the words of assessors: spans, rises, rings, piers, cover, fill.

The plane of a bridge is (x, z), its width goes along y; springings of all spans are at z = 0, and
the first span begins at x = 0. An intrados is cut into chords of equal length, joints stand at
right angles on it, and rings lie on each other along them, so that debonded rings fit exactly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import meant, members, not_negative, positive
from cvxlimit.errors import InputError
from cvxlimit.geometry.blocks import Block
from cvxlimit.geometry.strengths import DEFAULT_FRICTION
from cvxlimit.masonry.sizes import ALONG, Span, count, pile, prism, scene_of
from cvxlimit.scene import Load, Scene
from cvxlimit.scene.loads import GRAVITY
from cvxlimit.surroundings.reached import fill as fill_on

_FINE = 20_000
"""Chords by which the length of an intrados is measured, which makes voussoirs equal to 1e-8."""


@dataclass(frozen=True)
class Arch:
    """The intrados of a span, and how many voussoirs it has.

    Attributes
    ----------
    span, rise : float
        Clear span between springings, and height of the crown's intrados above them.
    shape : str
        ``"segment"`` of a circle (a semicircle where the rise is half the span), ``"parabola"``,
        ``"ellipse"``, ``"three-centred"`` (two small circles and a large one that touch, at angles
        of 60 degrees: the usual oval), or ``"points"``.
    points : (n, 2), optional
        Measured points of the intrados, from the left springing to the right one: x from there and
        height above it, with x growing. ``span`` is that of the last, ``rise`` that of the highest.
    voussoirs : int

    Raises
    ------
    InputError
        For sizes that are not positive, a rise above half the span where the shape has none, an
        unknown shape, and points that do not grow in x or do not begin and end at height 0.

    Example
    -------
    >>> Arch(6.0, 1.5).joints(0.4, 1).shape  # corners of 41 joints: intrados, extrados; x, z
    (41, 2, 2)
    """

    span: float
    rise: float
    shape: str = "segment"
    points: ArrayLike | None = None
    voussoirs: int = 40

    def __post_init__(self) -> None:
        count(self.voussoirs, "voussoirs", 2)
        if self.points is not None:
            at = np.array(self.points, dtype=float)
            is_right = at.ndim == 2 and at.shape[1] == 2 and len(at) > 2 and np.isfinite(at).all()
            if not is_right or not (np.diff(at[:, 0]) > 0.0).all() or at[[0, -1], 1].any():
                raise InputError(
                    "points of an arch must be (x, z) from its left springing to its right one, "
                    "with growing x, height 0 at both ends and at least one between; got "
                    f"{self.points!r:.80}"
                )
            object.__setattr__(self, "points", tuple(map(tuple, (at - at[0]).tolist())))
            object.__setattr__(self, "span", float(at[-1, 0] - at[0, 0]))
            object.__setattr__(self, "rise", float(at[:, 1].max()))
            object.__setattr__(self, "shape", "points")
        span, rise = positive(self.span, "span"), positive(self.rise, "rise")
        shapes = (*_INTRADOS, "points")
        if self.shape not in shapes or (self.shape == "points") != (self.points is not None):
            raise InputError(
                f"shape of an arch must be one of {', '.join(shapes)}, got {self.shape!r}"
                + meant(self.shape, shapes, before="; ")
                + ("; give points" if self.shape == "points" else "")
            )
        if self.shape in ("segment", "three-centred") and rise > 0.5 * span * (1.0 + 1e-9):
            raise InputError(
                f"a {self.shape} arch rises by at most half its span, {0.5 * span:g}, got "
                f"{rise:g}: an ellipse or a parabola may rise more"
            )
        self.intrados()  # refuses what its shape cannot be

    def intrados(self) -> tuple[FloatArray, FloatArray]:
        """Points (voussoirs + 1, 2) that cut the intrados into equal lengths, and its outward unit
        normals there."""
        if self.points is not None:
            fine = np.array(self.points)
        else:
            fine = _INTRADOS[self.shape](self.span, self.rise)
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(fine, axis=0), axis=1)))
        at = np.linspace(0.0, along[-1], self.voussoirs + 1)
        points = np.stack([np.interp(at, along, x) for x in fine.T], axis=1)
        # tangents of smooth shapes from the fine points; of measured ones the chords' mean
        if self.points is None:
            tangent = np.stack(
                [np.interp(at, along, np.gradient(x, along, edge_order=2)) for x in fine.T], axis=1
            )
        else:
            tangent = np.gradient(points, at, axis=0, edge_order=2)
        normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
        return points, normal / np.linalg.norm(normal, axis=1)[:, None]

    def joints(self, thickness: float, rings: int, start: float = 0.0) -> FloatArray:
        """Corners (voussoirs + 1, rings + 1, 2) of all joints, from the intrados outwards, of a
        span that begins at x = ``start``."""
        points, normal = self.intrados()
        steps = np.linspace(0.0, thickness, rings + 1)
        return points[:, None, :] + steps[:, None] * normal[:, None, :] + np.array([start, 0.0])


def _segment(span: float, rise: float) -> FloatArray:
    radius = (0.25 * span**2 + rise**2) / (2.0 * rise)
    half = np.arctan2(0.5 * span, radius - rise)
    angle = np.linspace(-half, half, _FINE + 1)
    x, z = radius * np.sin(angle), radius * np.cos(angle) - (radius - rise)
    return np.stack([x + 0.5 * span, z], axis=1)


def _parabola(span: float, rise: float) -> FloatArray:
    x = np.linspace(0.0, span, _FINE + 1)
    return np.stack([x, 4.0 * rise * x * (span - x) / span**2], axis=1)


def _ellipse(span: float, rise: float) -> FloatArray:
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _FINE + 1)
    return np.stack([0.5 * span * (1.0 + np.sin(angle)), rise * np.cos(angle)], axis=1)


def _three_centred(span: float, rise: float) -> FloatArray:
    """Small circles at the springings turn through 60 degrees, the large one through 60 in all."""
    half, turn = 0.5 * span, np.radians(30.0)
    s, c = np.sin(turn), np.cos(turn)
    # centres (small, 0) and (half, rise - large), on one line where the circles touch:
    # half - small = (large - small) s and large - rise = (large - small) c
    small = (rise * s - half * (1.0 - c)) / (s + c - 1.0)
    large = small + (half - small) / s
    if not small > 0.0:
        least = half * (1.0 - c) / s
        raise InputError(
            f"a three-centred arch over {span:g} rises by more than {least:.3g}, got {rise:g}: "
            "take a segment"
        )
    first = np.linspace(np.pi, np.pi / 2.0 + turn, _FINE // 3 + 1)
    middle = np.linspace(np.pi / 2.0 + turn, np.pi / 2.0 - turn, _FINE // 3 + 1)
    left = np.stack([small + small * np.cos(first), small * np.sin(first)], axis=1)
    top = np.stack([half + large * np.cos(middle), rise - large + large * np.sin(middle)], axis=1)
    right = np.stack([span - left[::-1, 0], left[::-1, 1]], axis=1)
    return np.concatenate([left, top[1:-1], right])


_INTRADOS: dict[str, Callable[[float, float], FloatArray]] = {
    "segment": _segment,
    "parabola": _parabola,
    "ellipse": _ellipse,
    "three-centred": _three_centred,
}


def bridge(
    spans: Arch | Sequence[Arch],
    *,
    thickness: float,
    rings: int = 1,
    width: float = 1.0,
    piers: tuple[float, float] | Sequence[tuple[float, float]] = (),
    pier_courses: int = 4,
    abutments: tuple[float, float] | None = None,
    cover: float | None = None,
    fill: float = 20.0,
    density: float = 22.0,
    friction: float = DEFAULT_FRICTION,
    ring_friction: float | None = None,
    compressive_strength: float = np.inf,
    live: Load | None = None,
    name: str = "bridge",
) -> Scene:
    """An arch bridge of one span or several, on piers and between abutments, under its fill.

    Voussoirs are ``v1``, ``v2`` ... from the left, with ``r2.`` in front for the second ring from
    the intrados, and ``s2.`` in front of that for the second span, where there are several of them;
    pier blocks ``p1.1`` ... from the bottom, with a cap ``p1.cap`` where springings are inclined.

    Parameters
    ----------
    spans : Arch or sequence of Arch
        From left to right.
    thickness : float
        Of all rings together, at right angles to the intrados.
    rings : int
        Rings that may come apart, of equal thickness; 1 for a bonded arch.
    width : float
        Out of the plane.
    piers : (width, height), or one for each
        Width between the springings of two spans, and height from the ground to them.
    pier_courses : int
        Blocks of each pier's shaft.
    abutments : (width, height), optional
        Blocks that may slide and tilt: behind the springing, and from the ground up to it. Unless
        given, skewbacks are fixed.
    cover : float, optional
        Depth of fill above the highest extrados; its surface is level. None: no fill.
    fill, density : float
        Weight per volume of fill and masonry. Fill is a dead load straight down; what it resists is
        :func:`~cvxlimit.passive`.
    friction, ring_friction : float
        Of joints, and between rings (as in other joints, unless given).
    compressive_strength : float
    live : Load, optional
        The weights along x, unless given; :class:`~cvxlimit.Road` makes a load on the road.

    Raises
    ------
    InputError
        For sizes that are not positive, and piers too narrow for two springings.

    Example
    -------
    >>> scene = bridge(Arch(6.0, 1.5), thickness=0.4, width=3.0, cover=0.3)
    >>> len(scene.free), len(scene.contacts)
    (40, 41)
    """
    every = members(spans or (spans,), Arch, "spans of a bridge must be Arch objects")
    deep, sides = positive(thickness, "thickness"), (0.0, positive(width, "width"))
    number, weight = count(rings, "rings"), positive(density, "density")
    shafts = _of_piers(piers, len(every) - 1)
    # springings of all spans, one after the other, and their joints
    starts = np.cumsum([0.0, *(a.span + p[0] for a, p in zip(every[:-1], shafts, strict=True))])
    joints = [a.joints(deep, number, x) for a, x in zip(every, starts.tolist(), strict=True)]
    names = [f"s{k + 1}." if len(every) > 1 else "" for k in range(len(every))]
    laid = [_rings(*span, sides, weight) for span in zip(names, joints, strict=True)]
    blocks = [block for layers in laid for ring in layers for block in ring]
    for k, (one, other) in enumerate(pairwise(joints)):
        blocks += _pier(f"p{k + 1}", one[-1], other[0], shafts[k], pier_courses, sides, weight)
    blocks += _abutments(joints[0][0], joints[-1][-1], abutments, sides, weight)
    own = friction if ring_friction is None else not_negative(ring_friction, "ring_friction")
    meet = [x for layers in laid for both in pairwise(layers) for x in zip(*both, strict=True)]
    between = {(low.id, high.id): own for low, high in meet}
    scene = scene_of(blocks, ALONG, live, friction, name, contact_friction=between)
    scene = scene.with_strength(compressive_strength)
    if cover is None:
        return scene
    level = max(float(corners[:, -1, 1].max()) for corners in joints) + not_negative(cover, "cover")
    return scene.with_dead(replace(GRAVITY, points=fill_on(scene, level, fill)))


def _rings(prefix: str, joints: FloatArray, sides: Span, density: float) -> list[list[Block]]:
    """The voussoirs of each ring between ``joints`` (voussoirs + 1, rings + 1, 2), from the
    intrados outwards."""
    rings = []
    for r in range(joints.shape[1] - 1):
        name = f"{prefix}r{r + 1}.v" if joints.shape[1] > 2 else f"{prefix}v"
        outlines = ([one[r], one[r + 1], other[r + 1], other[r]] for one, other in pairwise(joints))
        rings.append([prism(f"{name}{i}", x, sides, density) for i, x in enumerate(outlines, 1)])
    return rings


def _of_piers(piers: ArrayLike, wanted: int) -> list[tuple[float, float]]:
    given = np.atleast_2d(np.array(piers, dtype=float)) if np.size(piers) else np.zeros((0, 2))
    if len(given) == 1 and wanted > 1:
        given = np.repeat(given, wanted, axis=0)
    if given.shape != (wanted, 2):
        raise InputError(
            f"piers must be (width, height), one for all or one for each of {wanted} between "
            f"{wanted + 1} spans, got {piers!r:.60}"
        )
    return [
        (positive(w, "width of a pier"), positive(h, "height of a pier")) for w, h in given.tolist()
    ]


def _pier(
    id: str, left: FloatArray, right: FloatArray, size: tuple[float, float], courses: int,
    sides: Span, density: float,
) -> Iterator[Block]:  # fmt: skip
    """Ground, shaft and cap between the last joint of a span and the first one of the next, both
    (rings + 1, 2)."""
    wide, high = size
    x0, x1 = float(left[0, 0]), float(right[0, 0])
    one, other = left[-1], right[-1]
    if one[0] > other[0] + 1e-9 * wide:
        need = wide + float(one[0] - other[0])
        raise InputError(
            f"pier {id!r} of width {wide:g} is too narrow for the springings on both sides of it, "
            f"which need {need:.4g}: make it wider, or the rings thinner"
        )
    levels = np.linspace(-high, 0.0, count(courses, "pier_courses") + 1)
    yield Block.box(f"{id}.ground", (x0, sides[0], -high - wide), (x1, sides[1], -high))
    yield from pile(f"{id}.", (x0, x1), sides, levels, density)
    if max(one[1], other[1]) > 1e-9 * wide:
        outline = [left[0], one, other, right[0]]
        if np.linalg.norm(other - one) <= 1e-6 * wide:
            outline.remove(other)
        yield prism(f"{id}.cap", outline, sides, density)


def _abutments(
    first: FloatArray, last: FloatArray, size: tuple[float, float] | None,
    sides: Span, density: float,
) -> Iterator[Block]:  # fmt: skip
    """Both ends of the bridge, at its first and last joint (rings + 1, 2): fixed skewbacks, or
    blocks on a ground."""
    for name, (inner, outer), way in (
        ("left", (first[0], first[-1]), -1.0),
        ("right", (last[0], last[-1]), 1.0),
    ):
        if size is None:  # at right angles to the joint, away from the span and down
            along = outer - inner
            back = way * np.array([along[1], -along[0]])
            back = back if back[1] <= 0.0 else -back
            outline = [inner, outer, outer + back, inner + back]
            yield prism(f"{name}-abutment", outline, sides, None)
            continue
        wide, high = (positive(x, f"{what} of abutments")
                      for x, what in zip(size, ("width", "height"), strict=True))  # fmt: skip
        end = inner[0] + way * wide
        if way * (outer[0] - end) > 1e-9 * wide:
            raise InputError(
                f"abutments of width {wide:g} are too narrow for the springing, which needs "
                f"{abs(outer[0] - inner[0]):.4g}"
            )
        outline = [inner, outer, (end, outer[1]), (end, -high), (inner[0], -high)]
        distinct = [p for i, p in enumerate(outline)
                    if np.linalg.norm(np.subtract(p, outline[i - 1])) > 1e-9 * wide]  # fmt: skip
        yield prism(f"{name}-abutment", distinct, sides, density)
        low, top = sorted((float(inner[0]), float(end)))
        yield Block.box(f"{name}-ground", (low - wide, sides[0], -high - wide),
                        (top + wide, sides[1], -high))  # fmt: skip

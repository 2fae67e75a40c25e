"""Overlays of polygons that do not fail, whatever rounding makes of their coordinates.

GEOS ends in an exception where lines that nearly coincide cross at points that rounding moves past
each other. On a grid, to which it snaps all corners and crossings, that should not happen; where it
does, a coarser grid is another chance, and what is left unmerged even then can still be drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import shapely

Regions = np.ndarray[Any, np.dtype[np.object_]]
"""Polygons of shapely, one for each face."""

COARSER = (1.0, 4.0, 16.0)
"""Grids that are tried in turn, over that which was asked for: corners fall otherwise on each."""


def union(
    regions: Sequence[shapely.Geometry] | Regions, grid: float, is_snapped: bool = False
) -> shapely.Geometry:
    """All regions as one: on coordinates as they are, which takes half the time, else on a grid,
    else side by side. Snapped to it at once, regions that only nearly touch are joined."""
    merged = _first(shapely.union_all, [regions], grid, exactly=not is_snapped)
    parts = shapely.get_parts(regions).tolist()
    return shapely.GeometryCollection(parts) if merged is None else merged


def difference(
    region: shapely.Geometry, parts: Sequence[shapely.Geometry], grid: float
) -> shapely.Geometry:
    """What parts leave of a region, on a grid: all at once, else one after the other. What cannot
    be taken off stays."""
    together = _first(shapely.union_all, [parts], grid, exactly=True)
    if together is not None:
        left = _first(shapely.difference, [region, together], grid)
        if left is not None:
            return left
    for part in parts:
        left = _first(shapely.difference, [region, part], grid)
        region = region if left is None else left
    return region


def intersections(one: Regions, other: Regions, grid: float) -> Regions:
    """What regions (n,) share pair by pair: on coordinates as they are, else on a grid; nothing
    where both fail."""
    with suppress(shapely.GEOSException):
        shared = np.asarray(shapely.intersection(one, other))
        mixed = shapely.get_type_id(shared) == shapely.GeometryType.GEOMETRYCOLLECTION
        shared[mixed] = [_pure(region) for region in shared[mixed]]
        return shared
    shared = np.full(len(one), shapely.Polygon(), dtype=object)
    for i, pair in enumerate(zip(one, other, strict=True)):
        found = _first(shapely.intersection, pair, grid, exactly=True)
        shared[i] = shared[i] if found is None else found
    return shared


def _first(
    overlay: Callable[..., shapely.Geometry],
    given: Sequence[Any],
    grid: float,
    exactly: bool = False,
) -> shapely.Geometry | None:
    """The first answer that there is, ``exactly`` or on one grid after the other."""
    grids = [times * grid for times in COARSER]
    for size in (None, *grids) if exactly else grids:
        with suppress(shapely.GEOSException):
            return _pure(overlay(*given, grid_size=size))
    return None


def _pure(region: shapely.Geometry) -> shapely.Geometry:
    """An area without the lines and points to which parts of it have shrunk: of a mixture GEOS
    takes off next to nothing, and says nothing."""
    if region.geom_type != "GeometryCollection":
        return region
    parts = shapely.get_parts(region)
    areas = parts[shapely.get_dimensions(parts) == 2]
    return shapely.multipolygons(areas) if len(areas) else shapely.Polygon()


def without_holes(shape: shapely.Geometry) -> Iterator[shapely.Polygon]:
    """Polygons that tile a shape, counter-clockwise, cut through the middles of holes."""
    for part in shapely.get_parts(shapely.orient_polygons(shape)):
        if not isinstance(part, shapely.Polygon) or not part.interiors:
            if isinstance(part, shapely.Polygon):
                yield part
            continue
        left, low, right, high = part.bounds
        middle = part.interiors[0].centroid.x
        for half in (shapely.box(left, low, middle, high), shapely.box(middle, low, right, high)):
            yield from without_holes(part.intersection(half))

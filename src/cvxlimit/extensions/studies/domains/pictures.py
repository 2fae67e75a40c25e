"""Pictures of load domains: loads that are carried, loads that are ruled out, and those between."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from cvxlimit.base.arrays import FloatArray, IntArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.polytopes import ROUNDED
from cvxlimit.plotting.look import printable, saved
from cvxlimit.plotting.notebook import card
from cvxlimit.plotting.pictures.webpage import Page, framed
from cvxlimit.plotting.registry import figures
from cvxlimit.plotting.style import Style

_ALIKE = 0.2
"""Natural units of two loads that differ by less than this share have one scale."""

_POINTS = ("proved point", "mirror image of one, checked as well")

_ADVICE = "What lies inside is carried; what lies beyond the dashed lines is ruled out."
_POINTS_ONLY = "Points are proved one by one; nothing holds between them."
_SHOWN = "Where a set reaches the frame it goes on; hollow points are mirror images of others."


def draw_domain(
    domains: Any,
    path: str | os.PathLike[str] | None = None,
    **options: Any,
) -> Any:
    """Draws one load domain or several nested ones: two loads as a figure, three as a page to turn.

    The region that is proved to be carried is dark, and the strip between it and what half-spaces
    rule out is light. Points were solved for; hollow ones are their mirror images. Where nothing is
    proved between points, they stand alone.

    Parameters
    ----------
    domains : LoadDomain or sequence of LoadDomain
        Of the same loads.
    path : path or None
        With one, a file: ``.png``, ``.svg`` or ``.pdf``; ``.html`` for a page.
    options
        ``ax``, ``figsize``, ``title`` and ``legend`` of a figure: those of
        :func:`cvxlimit.plotting.picture`. With the first or the second, three loads make one too,
        in space.

    Raises
    ------
    InputError
        For a suffix that does not go with it, and for a page that is given options of figures.
    ModelError
        If Matplotlib is not installed.
    """
    each = list(domains) if isinstance(domains, Sequence) else [domains]
    suffix = "" if path is None else Path(path).suffix.lower()
    is_figure = len(each[0].units) == 2 or bool({"ax", "figsize"} & options.keys())
    if suffix == ".html" and options:
        raise InputError(f"a page has no {min(options)}: leave it out, or name a .png")
    if suffix == ".html" or not (suffix or is_figure):
        picture: Any = domain_page(each)
    else:
        picture = _drawn(each, **options)
    return picture if path is None else saved(picture, path, options)


def _drawn(domains: Sequence[Any], **options: Any) -> Any:
    """Returns the figure of domains of the same two or three loads."""
    is_flat = len(domains[0].units) == 2
    chart = figures("sheet").Sheet.of((6.2, 5.4), None if is_flat else "3d", **options)
    ax, first, frame = chart.axes, domains[0], _frame(domains)
    for domain, colour in zip(domains, cycle(Style.series), strict=False):
        label = _label(domain) if len(domains) > 1 else "carried"
        (_draw_flat if is_flat else _draw_solid)(ax, domain, frame, colour, label)
    for axis, name, ends in zip("xyz", first.names, frame.T, strict=False):
        ax.set(**{f"{axis}label": f"{printable(name)} (load factor)", f"{axis}lim": tuple(ends)})
    if is_flat:
        ax.axhline(0.0, color=Style.axis, lw=0.6, zorder=0)
        ax.axvline(0.0, color=Style.axis, lw=0.6, zorder=0)
        if np.ptp(first.units) <= _ALIKE * first.units.max():
            ax.set_aspect("equal")
        kinds = {
            s.is_mirrored for domain in domains for s in domain.supports if s.point is not None
        }
        for is_mirrored in sorted(kinds):
            face = "white" if is_mirrored else Style.thin
            ax.plot(
                [], [], "o", ms=3.5, mfc=face, mec=Style.thin, mew=0.8, label=_POINTS[is_mirrored]
            )
    chart.write(_title(domains))
    return chart.figure


def _frame(domains: Sequence[Any]) -> FloatArray:
    """Returns a frame (2, k) that holds those of all domains."""
    low, high = np.array([domain.frame for domain in domains]).swapaxes(0, 1)
    return np.stack([low.min(axis=0), high.max(axis=0)])


def _draw_flat(ax: Any, domain: Any, frame: FloatArray, colour: str, label: str) -> None:
    shade = 1.0 if label == "carried" else 0.2  # several lie upon each other
    # Shapes end outside the axes, so that no line closes a set that goes on.
    inside, outside = domain.shapes(
        frame + 0.1 * np.array([-1.0, 1.0])[:, None] * np.ptp(frame, axis=0)
    )
    if len(outside):
        ax.fill(*outside.T, color=colour, alpha=0.16 * shade, lw=0, zorder=1)
        ax.plot(*np.vstack([outside, outside[:1]]).T, color=colour, lw=0.6, ls="--", zorder=2,
                label="beyond it: ruled out" if label == "carried" else None)  # fmt: skip
    if len(inside):
        ax.fill(*inside.T, color=colour, alpha=0.45 * shade, lw=0, zorder=1.5)
        ax.plot(*np.vstack([inside, inside[:1]]).T, color=colour, lw=1.2, zorder=2.5, label=label)
    for is_mirrored in (False, True):
        points = [s.point for s in domain.supports
                 if s.point is not None and s.is_mirrored == is_mirrored]  # fmt: skip
        if points:
            face = "white" if is_mirrored else colour
            ax.plot(*np.array(points).T, "o", ms=3.5, mfc=face, mec=colour, mew=0.8, zorder=3)


def _draw_solid(ax: Any, domain: Any, frame: FloatArray, colour: str, label: str) -> None:
    from mpl_toolkits.mplot3d.art3d import (  # type: ignore[import-untyped]
        Line3DCollection,
        Poly3DCollection,
    )

    inside, outside = domain.shapes(frame)
    if len(inside):
        faces = _faces(inside)
        body = Poly3DCollection(
            inside[_alike(faces)], facecolors=colour, edgecolors="white", lw=0.4, alpha=0.85,
            shade=True,
        )  # fmt: skip
        ax.add_collection3d(body, autolim=False)
    else:
        ax.plot(*domain.points.T, "o", ms=3, color=colour)
    lines = outside[_open_edges(outside, frame)]
    dashed = Line3DCollection(lines, colors=Style.thin, lw=0.4, ls="--")
    ax.add_collection3d(dashed, autolim=False)
    ax.locator_params(nbins=4)  # more overlap in a narrow figure
    ax.set_box_aspect(None, zoom=0.8)  # which leaves labels on the paper


def _open_edges(corners: FloatArray, frame: FloatArray) -> IntArray:
    """Returns the edges (n, 2) between faces of a body that do not lie in a side of the frame,
    where it is only cut off."""
    sides = np.hstack([np.isclose(corners, end, atol=1e-9 * np.ptp(frame)) for end in frame])
    edges = {
        (min(a, b), max(a, b))
        for face in _faces(corners) for a, b in zip(face, [*face[1:], *face[:1]], strict=True)
        if not (sides[a] & sides[b]).any()
    }  # fmt: skip
    return np.array(sorted(edges), dtype=int).reshape(-1, 2)


def _alike(faces: Sequence[Sequence[int]]) -> IntArray:
    """Returns faces with corners repeated until all have equally many: Matplotlib 3.10 fills up
    those that are shorter with numbers that nobody set, and warns of them. Evenly, since three
    corners a third of the way apart give the normal to shade by."""
    most = max(map(len, faces), default=0)
    return np.array([[f[k * len(f) // most] for k in range(most)] for f in faces], dtype=int)


def domain_page(domains: Sequence[Any]) -> Page:
    """Returns the domains as a page to turn, in one file; those of two loads are plane there.

    In the plane the page has the half-spaces that the domain itself answers by, so that it says the
    same anywhere; in space it has what lies within the frame.
    """
    first, frame = domains[0], _frame(domains)
    data: dict[str, Any] = {
        "title": _title(domains), "names": list(first.names), "bodies": [],
        "advice": f"{_ADVICE if first.inner is not None else _POINTS_ONLY} {_SHOWN}",
        "equal": bool(np.ptp(first.units) <= _ALIKE * first.units.max()),
        "box": frame.tolist(), "kinds": _POINTS,
    }  # fmt: skip
    for domain, colour in zip(domains, cycle(Style.series), strict=False):
        shapes = domain.shapes(frame) if len(first.units) == 3 else (None, None)
        for body, corners, is_inner in zip(
            (domain.inner, domain.outer), shapes, (True, False), strict=True
        ):
            made = {"colour": colour, "inner": is_inner, "label": _label(domain), "points": []}
            if corners is not None:
                edges = [] if is_inner else _open_edges(corners, frame).tolist()
                made |= {
                    "corners": corners.tolist(),
                    "faces": _faces(corners) if is_inner else edges,
                }
            elif body is not None:
                made |= {"units": domain.units.tolist(), "normals": body.normals.tolist(),
                         "offsets": body.offsets.tolist()}  # fmt: skip
                if is_inner:
                    made |= {name: getattr(body, name).T.tolist() for name in ("origin", "basis")}
                    made |= {"across": body.across.tolist(), "rounded": ROUNDED}
            if is_inner:
                made["points"] = [[s.point.tolist(), s.is_mirrored] for s in domain.supports
                                  if s.point is not None]  # fmt: skip
            data["bodies"].append(made)
    return framed("domain.html", data, __package__)


def domain_html(domain: Any) -> str:
    """Returns the domain's data beside its picture as HTML, for notebooks."""
    rows = [
        ("loads", ", ".join(domain.names)),
        ("largest gap", domain.gap_said if domain.is_convex else "points one by one"),
        ("status", str(domain.status)),
        ("surface", domain.surface if domain.method == "convex" else
         f"{domain.surface}, {domain.method}"),
        *((f"along {name}", found) for name, found in domain.extent().items()),
        ("solves", f"{domain.solves} in {domain.seconds:.1f} s"),
    ]  # fmt: skip
    image = None
    if len(domain.points):
        image = _drawn([domain]).file("png")
    return card(printable(domain.scene_name), iter(rows), image)


def _label(domain: Any) -> str:
    return printable(str(domain.surface if domain.method == "convex" else domain.method))


def _title(domains: Sequence[Any]) -> str:
    first = domains[0]
    name = printable(first.scene_name)
    if len(domains) > 1:
        return f"{name}: loads that are carried, by surface"
    how = f"proved to {first.gap_said}" if np.isfinite(first.gap) else "some proved points"
    end = ", without end where the frame cuts it off" if len(first.rays) else ""
    return f"{name}: loads that are carried beside the dead load, {how} ({_label(first)}){end}"


def around(corners: FloatArray) -> IntArray:
    """Returns the order (n,) of a convex polygon's corners (n, 2) around it."""
    arm = corners - corners.mean(axis=0)
    size = np.abs(arm).max(axis=0)
    arm = arm / np.where(size > 0.0, size, 1.0)
    return np.argsort(np.arctan2(arm[:, 1], arm[:, 0]))


def _faces(corners: FloatArray) -> list[list[int]]:
    """Returns the faces of the convex hull of corners (n, k) as polygons, one if they are flat."""
    if len(corners) < 3:
        return [list(range(len(corners)))]
    if corners.shape[1] == 2:
        return [around(corners).tolist()]
    scaled = corners / np.maximum(np.ptp(corners, axis=0), 1e-300)
    try:
        hull = ConvexHull(scaled)
    except QhullError:
        spread = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)[2]
        return [around((scaled - scaled.mean(axis=0)) @ spread[:2].T).tolist()]
    result = []
    for plane in np.unique(hull.equations.round(7), axis=0):
        own = np.flatnonzero(np.abs(hull.equations - plane).max(axis=1) < 1e-6)
        at = np.unique(hull.simplices[own])
        if len(at) < 3:
            continue
        across = np.linalg.svd(plane[None, :3])[2][1:]
        result.append(at[around(scaled[at] @ across.T)].tolist())
    return result

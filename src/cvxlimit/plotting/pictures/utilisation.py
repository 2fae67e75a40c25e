"""How much of its strength each joint uses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np

from cvxlimit.base.arrays import SMALL, FloatArray
from cvxlimit.plotting.annotations import Decal
from cvxlimit.plotting.contents import Bar, Drawing, Viewer, at_rest
from cvxlimit.plotting.look import USE_STOPS, USE_TEXT, used_colour
from cvxlimit.plotting.registry import picture
from cvxlimit.results.utilisation import forces_of, least_used_state, share_used
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

IDLE_COLOUR = "#dfe1e4"


@picture
def utilisation(
    solution: Solution,
    *,
    surface: str | None = None,
    load_factor: float | None = None,
    state: Literal["least-used", "found"] = "least-used",
    viewer: Viewer = None,
) -> Drawing:
    """How much of its strength each joint uses: joints as areas from light (nothing) to dark (all).

    Many states of force carry a load factor, and the one that a solver happens to find shows joints
    at their strength that need not be. Shown is the state that uses joints least: of all that are
    in equilibrium and admissible, the one with the least sum of N u * u, with u the share in use.
    At collapse whatever moves, however slowly, is at its strength in every state; ``load_factor``
    shows what is used below it. Joints that carry less than a hundredth of the largest compression
    are grey.

    Parameters
    ----------
    solution, viewer
        As for :func:`mechanism`; a solution must have forces.
    surface : str or None
        ``"rocking"``, ``"sliding"``, ``"torsion"``, ``"torsion-shear"``, one of those that were
        solved with, and with interaction ``"torsion-shear-bending"`` (Eq. 30); None is the largest
        of those that were solved with.
    load_factor : float or None
        At which strength is used, not above that of the solution; None is that one.
    state : {"least-used", "found"}
        Found is the state of the solution itself, that of its tables. With interaction, with ties
        and with the exact limit of torsion it is shown in any case.

    Example
    -------
    How far joints are used when half of what the wall carries acts:

    >>> from cvxlimit import builtin_scene, solve
    >>> solution = solve(builtin_scene("single-block"))
    >>> half = solution.load_factor / 2
    >>> type(solution.plot("utilisation", load_factor=half, figsize=(3.4, 3.0))).__name__
    'SceneFigure'
    """
    scene = solution.scene
    shown, said = solution, "at collapse, in the state of forces that was found"
    if state == "least-used":
        shown, said = least_used_state(solution, scene, load_factor)
    used = used_shares(shown, scene, surface)
    return at_rest(
        solution,
        viewer,
        f"strength in use {said}" + (f"; {surface}" if surface else ""),
        decals=list(joint_areas(scene, used, both=False)),
        bar=Bar(USE_STOPS, USE_TEXT),
        keys=idle_keys(used),
        glass=True,
    )


def used_shares(solution: Solution, scene: Scene, surface: str | None = None) -> FloatArray:
    """Shares (n,) in use, NaN where a joint carries next to nothing."""
    used, normal = share_used(solution, scene, surface), forces_of(scene, solution)[:, 2]
    return np.where(np.abs(normal) < SMALL * np.abs(normal).max(initial=0.0), np.nan, used)


def idle_keys(used: FloatArray) -> list[tuple[str, str]]:
    text = f"joint with less than {100 * SMALL:g} % of the largest compression"
    return [(IDLE_COLOUR, text)] if np.isnan(used).any() else []


def joint_areas(scene: Scene, used: FloatArray, both: bool) -> Iterator[Decal]:
    """The joints' areas in the colour of their shares, on one block or on both."""
    contacts = scene.contacts
    for j in range(len(contacts)):
        colour = IDLE_COLOUR if np.isnan(used[j]) else used_colour(min(float(used[j]), 1.0))
        for block in (int(contacts.a[j]), int(contacts.b[j]))[: 1 + both]:
            for piece in contacts.piece_points(j):
                yield Decal(piece, block, colour)

"""What all kinds of plot share: colours, the title, legend texts."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.base.checks import meant
from cvxlimit.base.files import write_file
from cvxlimit.errors import InputError
from cvxlimit.plotting.annotations import JointKind, Marking, joint_kinds
from cvxlimit.plotting.style import Style
from cvxlimit.results.movement import Motion
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution, Status
from cvxlimit.solution.bracket import rounded
from cvxlimit.solution.kinematics import ContactKind

KIND_COLOURS = {
    ContactKind.OPENS: Style.red,
    ContactKind.SLIDES: Style.amber,
    ContactKind.TWISTS: Style.violet,
}

KIND_TEXTS = {kind: f"contact {kind.name.lower()}" for kind in KIND_COLOURS}

JOINT_COLOURS = {
    JointKind.BED: Style.bed,
    JointKind.HEAD: Style.head,
    JointKind.SLOPING: Style.sloping,
}

JOINT_TEXTS = {kind: f"{kind.name.lower()} joint" for kind in JOINT_COLOURS}

CASE_COLOURS = {"dead": Style.dead, "live": Style.live}
"""Arrows of the two load cases."""

SPEED_TEXT = "largest corner speed of the block / largest of all"
WAY_TEXT = "way of the block's farthest corner / farthest of all"
USE_TEXT = "share of strength in use"


def used_colour(share: float) -> str:
    return "#" + "".join(f"{round(255 * c):02x}" for c in mixed(Style.use, share).tolist())


def rgb(colour: str) -> FloatArray:
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def mixed(stops: Sequence[str], share: FloatArray | float) -> FloatArray:
    known = np.array([rgb(c) for c in stops])
    at = np.linspace(0.0, 1.0, len(known))
    return np.stack([np.interp(share, at, column) for column in known.T], axis=-1)


def block_colours(
    scene: Scene, motion: Motion, culprits: frozenset[str] = frozenset(), stone: str = Style.stone
) -> FloatArray:
    if motion.moves:
        colours = mixed(Style.speed, motion.speed)
    else:
        colours = np.tile(rgb(stone), (len(scene.blocks), 1))
    colours[np.setdiff1d(np.arange(len(colours)), scene.free)] = rgb(Style.support)
    colours[[block.id in culprits for block in scene.blocks]] = rgb(Style.culprit)
    return colours


SLOW = 0.05
"""Joints that move by less than this share of the fastest are not drawn: where sliding dilates,
nearly every joint of a wall moves a little, and a hundred lines say nothing."""

THINNEST = 0.22
"""Width of the joint that moves least, as a share of that which moves most: still to be seen."""


def moving_joints(scene: Scene, moving: Motion, widest: float = 1.0) -> Marking:
    """Marks joints as wide as they move, so that many small slips do not hide what fails."""
    what = moving.contacts
    kinds = {kind: KIND_COLOURS[kind] for kind in KIND_COLOURS if moving.moves}
    slides = np.isin(what.kind, (ContactKind.SLIDES, ContactKind.TWISTS))
    rate = np.where(slides, what.slip, what.widest)
    largest = float(rate[what.kind != ContactKind.CLOSED].max(initial=0.0))
    share = np.clip(rate / largest, 0.0, 1.0) if largest > 0.0 else np.ones(len(rate))
    width = THINNEST + (widest - THINNEST) * share
    drawn = np.where(share < SLOW, ContactKind.CLOSED, what.kind)
    return Marking(scene.contacts, drawn, kinds, KIND_TEXTS, width)


def scene_joints(scene: Scene) -> Marking:
    return Marking(scene.contacts, joint_kinds(scene, scene.contacts), JOINT_COLOURS, JOINT_TEXTS)


DIGITS = 5
"""Of load factors on pictures."""

_FRICTION = {
    "conic": "Coulomb friction",
    "octagon": "octagonal friction",
    "parabolic": "Coulomb friction with parabolic torsion",
    "exact": "Coulomb friction with exact torsion",
}
_BENDING = {
    "certified": "interaction with bending",
    "fixed-point": "interaction with bending, iterated",
}
"""What an engineer calls them."""


def title(solution: Solution) -> str:
    """Scene, friction, load factor; the status without an answer.

    The bracket stands beside it where it is wider than what is printed, with the status: its ends
    are rounded outwards, so that what is printed is still a bracket. Characters that do not print
    are replaced.

    Example
    -------
    >>> from cvxlimit.solution.bracket import Bracket
    >>> from cvxlimit.solution import Solution, Status
    >>> title(Solution("tuff-wall", "conic", "none", "signed", 122, 314, 0.423058,
    ...                Bracket(0.423056, 0.4230593), Status.CERTIFIED, (), {}))
    'tuff-wall, Coulomb friction: load factor α = 0.42306'
    """
    surface = solution.surface_name
    what = f"{printable(solution.scene_name)}, {_FRICTION.get(surface, printable(surface))}"
    if solution.interaction in _BENDING:
        what += f", {_BENDING[solution.interaction]} ({solution.moments} moments)"
    elif solution.interaction != "none":
        what += f", {solution.interaction}"
    symbol = printable(solution.quantity)
    symbol += " \N{GREEK SMALL LETTER ALPHA} =" if symbol == "load factor" else ""
    standing, is_bounded = solution.standing, solution.bracket.has_any
    if solution.load_factor is None or not (solution.status.is_good or is_bounded):
        reach = f"{symbol} {solution.range_text}" if solution.range_text else standing
        return f"{what}: {reach}"
    if solution.flow == "zero-dilatancy" and not solution.bracket.lower_is_proved:
        symbol = f"lowest found, {symbol}"
    says = standing != "certified" and standing != str(Status.CONVERGED)
    is_narrow = solution.status.is_good and solution.gap <= 10.0**-DIGITS
    has_bracket = solution.bracket.has_any and not is_narrow
    inside = f" in {solution.bracket.shown(DIGITS)}" if has_bracket else ""
    doubt = f" ({standing})" if says else ""
    value = solution.range_text or rounded(solution.load_factor, DIGITS)
    return f"{what}: {symbol} {value}{inside}{doubt}"


def scene_title(scene: Scene) -> str:
    free, fixed = len(scene.free), len(scene.blocks) - len(scene.free)
    blocks = "1 free block" if free == 1 else f"{free} free blocks"
    supports = "1 support" if fixed == 1 else f"{fixed} supports"
    return f"{printable(scene.name)}: {blocks}, {supports}"


def printable(text: str) -> str:
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in text)


IMAGES = (".png", ".svg", ".pdf")
"""Files of figures; in SVG and PDF everything is lines, faces and letters."""


class Saved(ABC):
    """What can be written to a file: ``suffixes`` say how, ``file`` gives the bytes."""

    suffixes: ClassVar[tuple[str, ...]]

    @abstractmethod
    def file(self, kind: str) -> bytes: ...

    def save(self, path: str | os.PathLike[str]) -> Path:
        target = with_suffix(path, self.suffixes)
        write_file(target, self.file(target.suffix.lower().removeprefix(".")))
        return target


def saved(picture: Any, path: str | os.PathLike[str], options: Mapping[str, Any]) -> Path:
    """The file of a picture that was drawn with options of a caller's."""
    if options.get("ax") is not None:
        raise InputError("a picture in axes is part of their figure: save that with savefig")
    result: Path = picture.save(path)
    return result


def of_kind(
    what: str, kinds: Mapping[str, Callable[..., Any]], kind: str, thing: Any,
    file: str | os.PathLike[str] | None, options: dict[str, Any],
) -> Any:  # fmt: skip
    """Draws the picture of that ``kind``; returns it, or the file it is saved to."""
    if kind not in kinds:
        raise InputError(
            f"{what} has no picture {kind!r}: choose one of {', '.join(kinds)}"
            + meant(kind, kinds, before="; ")
        )
    picture = kinds[kind](thing, **options)
    return picture if file is None else saved(picture, file, options)


def with_suffix(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> Path:
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise InputError(
            f"cannot tell what to draw from {target.name!r}: give a name that ends in "
            f"{' or '.join(suffixes)}"
        )
    return target

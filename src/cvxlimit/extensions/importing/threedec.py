"""Blocks of 3DEC's data files: ``poly brick``, ``poly prism``, ``poly face``, and the words that
newer versions have for the same, ``block create ...``.

A data file is a program. What makes a block of numbers is read; what cuts, joins or removes blocks,
or computes them, is refused by its line, as the blocks would not be those of the model; all other
commands are left alone and named. Keywords may be cut short after three letters; ``&`` at the end
of a line joins the next to it, ``;`` begins a comment, brackets and commas say nothing.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.io.fields import decoded, read_bytes, shown

_CHANGING = (
    "jset", "cut", "tunnel", "join", "delete", "excavate", "remove", "split", "call", "fish",
    "def", "define", "loop", "densify", "import", "generate-from", "separate", "restore", "move",
    "rotate", "translate", "program", "stl", "vrml",
)  # fmt: skip
"""Words, as the first or second of a command, by which other blocks may come about than those that
the file writes out."""

_MODIFIERS = {"region": 1, "material": 1, "constitutive": 1, "group": 1, "slot": 1, "name": 1,
              "density": 1}  # fmt: skip
"""Words beside a block's numbers, and how many words follow each."""


def read_threedec(path: Path, notes: list[str]) -> list[Body]:
    """The blocks of a data file, in its order, under their groups or regions where it has any."""
    made, left = list[Body](), Counter[str]()
    for number, words in _commands(path):
        first, second = words[0].lower(), words[1].lower() if len(words) > 1 else ""
        if _is(first, "polyhedron", 3) and len(words) > 1:
            made.append(_block(words[1:], number))
        elif first == "block" and _is(second, "create", 3):
            made.append(_block(words[2:], number))
        elif first.startswith(("@", "[")) or {first, second} & {*_CHANGING}:
            raise InputError(
                f"line {number}: {shown(' '.join(words[:4]))} makes other blocks than those that "
                "are written out: run the file in 3DEC, and write the blocks as they are then, or "
                "export them as STL"
            )
        else:
            left[first] += 1
    if left:
        notes.append(
            f"of the data file only blocks are read, and these commands are left alone: "
            f"{', '.join(list(left)[:12])}{' ...' if len(left) > 12 else ''}"
        )
    return made


def _commands(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The words of each command, and the number of its last line."""
    begun = ""
    for number, line in enumerate(decoded(read_bytes(path)).splitlines(), 1):
        line = line.split(";", 1)[0].rstrip()
        is_joined = line.endswith(("&", "..."))
        begun += f" {line.rstrip('&.') if is_joined else line}"
        if is_joined:
            continue
        words = re.findall(r"'[^']*'|\"[^\"]*\"|[^\s(),=]+", begun)
        begun = ""
        if words:
            yield number, words
    if begun.strip():
        raise InputError("the last line says that another follows: the file is cut off")


def _is(word: str, keyword: str, least: int) -> bool:
    """True for a keyword, or its first letters, of which there are enough."""
    return len(word) >= least and keyword.startswith(word)


def _block(words: Sequence[str], number: int) -> Body:
    """One block: what it is, its numbers, and words beside them."""
    kind, parts, named = "", list[list[float]](), dict[str, str]()
    rest = iter(words)
    for word in rest:
        lower = word.lower()
        modifier = next((each for each in _MODIFIERS if _is(lower, each, 3)), None)
        if modifier is not None:
            named[modifier] = next(rest, "").strip("'\"")
        elif not kind and (found := next(
            (each for each in ("brick", "prism") if _is(lower, each, 2)), None
        )):  # fmt: skip
            kind = found
            parts += [[]] * (kind == "brick")
        elif lower in ("a", "b", "face-1", "face-2") and kind == "prism":
            parts.append([])
        elif lower in ("face", "polyhedron") and kind in ("", "face"):
            kind = "face"
            parts += [[]] * (lower == "face")
        else:
            try:
                parts[-1] = [*parts[-1], float(word)]
            except (ValueError, IndexError) as error:
                raise InputError(
                    f"line {number}: {shown(word)} of a block is not known here; blocks are read "
                    "as brick, prism a ... b ..., and face ... face ..."
                ) from error
    name = named.get("group") or (f"region {named['region']}" if "region" in named else "")
    if kind == "brick":
        return _brick(name, parts[0], number)
    corners = [_points(part, number) for part in parts]
    if kind == "prism":
        return _prism(name, corners, number)
    if len(corners) < 4:
        raise InputError(f"line {number}: a block of faces needs four, got {len(corners)}")
    ends = np.cumsum([0, *map(len, corners)]).tolist()
    faces = [list(range(a, b)) for a, b in pairwise(ends)]
    points, place = np.unique(np.concatenate(corners), axis=0, return_inverse=True)
    place = np.asarray(place).reshape(-1)
    return Body(name, points, [place[face].tolist() for face in faces])


def _points(numbers: Sequence[float], number: int) -> FloatArray:
    if len(numbers) % 3 or len(numbers) < 9:
        raise InputError(
            f"line {number}: a face must have three or more corners of three numbers, got "
            f"{len(numbers)} numbers"
        )
    return np.array(numbers, dtype=float).reshape(-1, 3)


def _brick(name: str, numbers: Sequence[float], number: int) -> Body:
    """A box by xmin, xmax, ymin, ymax, zmin, zmax."""
    if len(numbers) != 6:
        raise InputError(
            f"line {number}: a brick must have six numbers, from and to along x, y and z, got "
            f"{len(numbers)}"
        )
    return Body(name, np.sort(np.array(numbers).reshape(3, 2)).T, (), is_box=True)


def _prism(name: str, ends: Sequence[FloatArray], number: int) -> Body:
    """What lies between two faces, of which corner i of one belongs to corner i of the other."""
    if len(ends) != 2 or len(ends[0]) != len(ends[1]):
        counts = " and ".join(str(len(end)) for end in ends) or "no"
        raise InputError(f"line {number}: a prism must have two faces alike, got {counts} corners")
    count = len(ends[0])
    around = [(i, (i + 1) % count) for i in range(count)]
    sides = [[i, k, count + k, count + i] for i, k in around]
    bottom, top = list(range(count))[::-1], list(range(count, 2 * count))
    return Body(name, np.concatenate(ends), [bottom, top, *sides])

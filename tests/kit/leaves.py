"""Every leaf of a stored answer changed, one at a time: each has to be refused, or named."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

from cvxlimit.errors import CvxlimitError
from cvxlimit.studies import Proof

Place = tuple[str | int, ...]

EVIDENCE = {
    "forces", "mechanism", "internal", "reference", "rates", "beside", "points", "displacements"
}  # fmt: skip
"""What proves claims and is none: with another one that proves all that is claimed, it is true."""

_WORDS = "zero-dilatancy", "octagon", "kN"
_FACTORS = 1.00001, 0.99999, -1.0
_EXCHANGED = "names exchanged with "
_SMALL = 1e-6
"""A number below it is nothing in scenes of this size: a little of it is no other claim."""


def changed(document: Any) -> Iterator[tuple[Place, str, Any]]:
    """Copies with one change each: the place, what was done, and the document."""
    for place, value in _places(document):
        for what, other in _changes(value):
            result = copy.deepcopy(document)
            holder = result
            for key in place[:-1]:
                holder = holder[key]
            holder[place[-1]] = other
            name = what.removeprefix(_EXCHANGED) if what.startswith(_EXCHANGED) else None
            yield place if name is None else (*place, name), what, result


def unnoticed(
    document: Any, proof_of: Callable[[Any], Proof], every: int = 1, asked: tuple[str, ...] = ()
) -> list[str]:
    """Changes, or ``every`` so many of them, that are neither refused nor of an entry that the
    proof names as not looked at; ``asked`` are entries that say what was asked for."""
    first, found = proof_of(document), list[str]()
    assert first.is_proved, str(first)
    for i, (place, what, other) in enumerate(list(changed(document))[::every]):
        is_evidence = not EVIDENCE.isdisjoint(place)  # of which one change in seven will do
        if place[-1] in asked or (is_evidence and i % 7):
            continue
        try:
            proof = proof_of(other)
        except CvxlimitError:
            continue
        names = [check.claim for p in (first, proof) for check in p.of("not looked at")]
        if _is_told(place, other, str(proof)):
            continue
        if proof.is_proved and not (is_evidence or _is_named(place, names)):
            found.append(f"{'.'.join(map(str, place))}: {what}")
    return found


def _places(value: Any, at: Place = ()) -> Iterator[tuple[Place, Any]]:
    if at:
        yield at, value
    listed = enumerate(value) if isinstance(value, list) else ()
    for key, each in value.items() if isinstance(value, dict) else listed:
        yield from _places(each, (*at, key))


def _changes(value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, int | float) and not isinstance(value, bool):
        if isinstance(value, int):
            yield "one more", value + 1
        elif abs(value) > _SMALL:
            yield from ((f"times {factor}", factor * value) for factor in _FACTORS)
    if isinstance(value, str):
        yield from (("another text", word) for word in (*_WORDS, value + "x") if word != value)
    if isinstance(value, list) and value:
        yield "shortened", value[:-1]
    if isinstance(value, dict) and len(value) > 1:
        names = list(value)
        for one, other in pairwise(names):
            if not _is_same(value[one], value[other]):
                yield f"{_EXCHANGED}{one}", value | {one: value[other], other: value[one]}


def _is_same(one: Any, other: Any) -> bool:
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other) <= _SMALL * max(abs(one), abs(other))
    return bool(one == other)


def _is_told(place: Place, document: Any, said: str) -> bool:
    """Whether an entry is what was asked, which the proof tells: all is proved anew for that."""
    asked = document.get("tolerance") if place == ("tolerance",) else document.get("surface")
    told = f"({asked:.6g} asked for" if place == ("tolerance",) else f"surface {asked!r}"
    return place in (("tolerance",), ("surface",)) and told in said


def _is_named(place: Place, names: list[str]) -> bool:
    keys = [str(key) for key in place if not isinstance(key, int)]
    dotted = {".".join(keys[i:j]) for i in range(len(keys)) for j in range(i + 1, len(keys) + 1)}
    return any(word in dotted for name in names for word in name.replace(",", " ").split())

"""Aimed changes of a file, one at a time: what a hand or a slip could do to each of its entries."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator, Sequence
from typing import Any, get_args

from cvxlimit import Status
from cvxlimit.paths.path import Ending

Place = tuple[str | int, ...]

_WORDS = (
    *map(str, Status), *get_args(Ending), "conic", "octagon", "none", "certified", "associated",
    "zero-dilatancy", "convex", "exact", "linear", "yes", "no", "mm", "kN", "",
)  # fmt: skip
"""Words of which each text is exchanged for some."""

_FACTORS = (1.0 + 1e-5, 1.0 - 1e-5, 1.0 + 1e-3, -1.0, 0.0)


def mutations(document: Any, number: int, seed: int = 0) -> list[tuple[Place, str, Any]]:
    """At least ``number`` changed copies, if there are as many: the place, what was done, and the
    document. Every kind of entry comes first, long lists by chance."""
    rng = random.Random(seed)
    by_kind = dict[Place, list[Place]]()
    for place in _places(document):
        by_kind.setdefault(tuple("*" if isinstance(k, int) else k for k in place), []).append(place)
    ways = [(places, list(_changes(_at(document, places[0]), rng))) for places in by_kind.values()]
    made, turn = list[tuple[Place, str, Any]](), 0
    while len(made) < number and any(turn < len(changes) for _, changes in ways):
        for places, changes in ways:
            if turn < len(changes):
                place = rng.choice(places)
                found = [c for c in _changes(_at(document, place), rng) if c[0] == changes[turn][0]]
                made += [(place, what, _with(document, place, to)) for what, to in found[:1]]
        turn += 1
    return made


_GONE = object()


def _places(value: Any, at: Place = ()) -> Iterator[Place]:
    if at:
        yield at
    for key, each in value.items() if isinstance(value, dict) else ():
        yield from _places(each, (*at, key))
    for i, each in enumerate(value) if isinstance(value, list) else ():
        yield from _places(each, (*at, i))


def _at(value: Any, place: Place) -> Any:
    for key in place:
        value = value[key]
    return value


def _changes(value: Any, rng: random.Random) -> Iterator[tuple[str, Any]]:
    yield "gone", _GONE
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        for factor in _FACTORS:
            if (other := type(value)(factor * value)) != value:
                yield f"times {factor}", other
        yield "one more", value + 1
    if isinstance(value, str):
        for word in rng.sample(_WORDS, 6):
            if word != value:
                yield "another word", word
    if isinstance(value, list):
        yield "empty", []
        for what, other in (("turned round", value[::-1]), ("cut short", value[:-1])):
            if other != value and other:
                yield what, other
        if value:
            yield "one twice", [*value, value[0]]
    if isinstance(value, dict):
        yield "empty", {}
        keys = list(value)
        if len(keys) > 1:
            swapped = {**value, keys[0]: value[keys[-1]], keys[-1]: value[keys[0]]}
            if swapped != value:
                yield "two exchanged", swapped
    if value is not None:
        yield "null", None


def _with(document: Any, place: Place, to: Any) -> Any:
    result = copy.deepcopy(document)
    holder = _at(result, place[:-1])
    if to is _GONE:
        del holder[place[-1]]
    else:
        holder[place[-1]] = to
    return result


def is_named(place: Place, names: Sequence[str]) -> bool:
    """True if an entry is among what was not looked at: by its own name or that of what holds it,
    as ``note``, ``dilatancy.safe``, or ``solver, iterates``."""
    keys = [str(key) for key in place]
    dotted = {".".join(keys[i:j]) for i in range(len(keys)) for j in range(i + 1, len(keys) + 1)}
    return any(word in dotted for name in names for word in name.replace(",", " ").split())

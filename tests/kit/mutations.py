"""Aimed changes of a file, one at a time: what a hand or a slip could do to each of its entries."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable, Iterator, Sequence
from typing import Any, get_args

from cvxlimit import Status
from cvxlimit.errors import CvxlimitError
from cvxlimit.extensions.paths.path import Ending
from cvxlimit.studies import Proof

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


def _is_named(place: Place, names: Sequence[str]) -> bool:
    """True if an entry is among what was not looked at: by its own name or that of what holds it,
    as ``note``, ``dilatancy.safe``, or ``residual, iterates``."""
    keys = [str(key) for key in place]
    dotted = {".".join(keys[i:j]) for i in range(len(keys)) for j in range(i + 1, len(keys) + 1)}
    return any(word in dotted for name in names for word in name.replace(",", " ").split())


EVIDENCE = {"forces", "mechanism", "internal", "rates", "points", "displacements"}
"""What proves claims and is none: where all that is claimed is proved with another one, it is
true."""

_ASKED = {
    "components", "tolerance", "scene", "surface", "interaction", "moments", "torsion_shear", "flow"
}  # fmt: skip
"""What was asked, for which all is proved anew, and how columns are called."""


def _is_harmless(document: Any, place: Place, what: str) -> bool:
    """True for a change after which nothing false is said, so that a proof of all is right."""
    names, value = [str(key) for key in place], _at(document, place)
    last = [name for name in names if not name.isdigit()][-1]
    if (
        EVIDENCE & set(names)
        or last in _ASKED
        or "scene" in names[:1]
        or names[:2] == ["about", "base"]
    ):
        return True
    if "bracket" in names and (last in ("bracket", "proved") or what == "times 0.0"):
        return True  # nothing, or less, is called proved; widths count for more
    if last.endswith("is_proved"):
        return value == "yes" or _at(document, place[:-1])["point"] is None
    if last in ("units", "contact_names", "scene_digest") and names[0] == "initial":
        return what in ("gone", "empty", "null")  # the scene beside it has them
    if last == "dilatancy":
        return value is not None and value["share"] < 0.01  # too little to be told
    if what.startswith("times") and abs(value) < 1e-7:
        return True
    return (
        (names[0] == "loads" and len(place) == 3 and place[-1] == 0)  # what a load is called
        or (names[0] == "supports" and len(place) < 3)  # fewer, in another order, or twice
        or (place in (("rows",), ("proofs",)) and what in ("turned round", "one twice"))
        or (last == "point" and what == "times 0.0")  # the dead load alone
        or (last == "step" and what not in ("null", "times -1.0", "times 0.0"))  # at most
    )


def passing(document: Any, proof_of: Callable[[Any], Proof], number: int) -> list[str]:
    """What passes of ``number`` changes: neither refused nor named, and not harmless."""
    first = proof_of(document)
    assert first.is_proved, str(first)
    found = list[str]()
    for place, what, changed in mutations(document, number):
        try:
            proof = proof_of(changed)
        except CvxlimitError:
            continue
        named = [check.claim for p in (first, proof) for check in p.of("not looked at")]
        is_seen = not (_is_named(place, named) or _is_harmless(document, place, what))
        if proof.is_proved and is_seen:
            found.append(f"{'.'.join(map(str, place))}: {what}")
    return found

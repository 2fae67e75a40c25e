"""Checks of what users give; each refusal names the object and shows the value."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvxlimit.base.doors import Door
from cvxlimit.errors import InputError, ModelError


def is_number(value: Any) -> bool:
    number = (int, float, np.floating, np.integer)
    return isinstance(value, number) and not isinstance(value, bool)


def of_type(value: Any, kind: type | tuple[type, ...], what: str, cure: str = "") -> Any:
    """``value`` if it is a ``kind``; the refusal says ``what`` it should be and the ``cure``."""
    if not isinstance(value, kind):
        text = repr(value)
        short = text if len(text) <= 80 else f"{text[:60]} ..."
        raise InputError(f"{what}, got {short}{cure and f': {cure}'}")
    return value


def members(
    value: Any, kind: type | tuple[type, ...], what: str, cure: str = ""
) -> tuple[Any, ...]:
    if isinstance(value, kind):
        return (value,)
    return tuple(of_type(x, kind, what, cure) for x in of_type(value, Iterable, what, cure))


def meant(
    name: object, known: Iterable[str], otherwise: str = "", before: str = "", likeness: float = 0.6
) -> str:
    """Asks after that of the ``known`` names that is like ``name``, whatever the case of letters.

    Example
    -------
    >>> "no octogon" + meant("octogon", ["conic", "octagon"], before="; ")
    "no octogon; did you mean 'octagon'?"
    """
    alike = {each.lower(): each for each in sorted(known)}
    close = get_close_matches(str(name).lower(), alike, 1, likeness)
    return f"{before}did you mean {alike[close[0]]!r}?" if close else otherwise


def check_choice(what: str, value: object, allowed: Collection[str]) -> None:
    """Refuses a ``value`` that is none of the ``allowed`` names, or of those behind a door, and
    tells which extension it is of if that is missing."""
    if isinstance(value, str) and value in allowed:
        return
    if isinstance(allowed, Door) and isinstance(value, str):
        allowed.check(value)
    got = repr(value)
    if isinstance(value, type):
        got = f"the class {value.__name__}: write {value.__name__}()"
    known = allowed.names if isinstance(allowed, Door) else [*allowed]
    hint = meant(value, known, before="; ")
    raise ModelError(f"{what} must be one of {', '.join(known)}, got {got}{hint}")


def check_known(name: object, known: Collection[str], what: str) -> None:
    """Refuses a name that is not known; ``what`` begins the sentence: "there is no table"."""
    if name not in known:
        like = meant(name, known, before="; ")
        raise InputError(f"{what} {name!r}: choose one of {', '.join(known)}{like}")


def first_twice(names: Iterable[str]) -> str | None:
    seen = set[str]()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def positive(value: Any, what: str) -> float:
    if is_number(value) and -np.inf < value <= 0.0:
        raise InputError(f"{what} must be above 0, got {value!r:.40}")
    return not_negative(value, what)


def finite_vector(value: Any, length: int, what: str) -> NDArray[np.float64]:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{what} must be {length} numbers, got {value!r}") from error
    if array.shape != (length,):
        raise InputError(f"{what} must be {length} numbers, got {value!r}")
    if not np.isfinite(array).all():
        raise InputError(f"{what} must be finite, got {array.tolist()}")
    return array


def not_negative(value: Any, what: str) -> float:
    if not is_number(value):
        is_symbol = type(value).__module__.startswith("cvxpy.")
        cure = ": Parameters go into LimitProblem(scene, friction=...)" if is_symbol else ""
        raise InputError(f"{what} must be a number, got {value!r}{cure}")
    if not 0.0 <= value <= sys.float_info.max:
        raise InputError(f"{what} must be finite and not negative, got {value!r:.40}")
    return float(value)


def strength(value: Any, what: str) -> float:
    return float("inf") if is_number(value) and value == float("inf") else positive(value, what)


def ratio(value: Any, what: str) -> float:
    if not (is_number(value) and 0.0 < value < 1.0):
        raise ModelError(f"{what} must be between 0 and 1, got {value!r}")
    return float(value)


def count(value: Any, least: int, what: str) -> int:
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not (whole and value >= least):
        raise ModelError(f"{what} must be at least {least} and whole, got {value!r}")
    return int(value)

"""Files of load domains: ``cvxlimit-domain``, version 1."""

from __future__ import annotations

from typing import Any

import numpy as np

from cvxlimit.base.checks import first_twice
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.domains.domain import LoadDomain
from cvxlimit.extensions.studies.domains.supports import Support
from cvxlimit.io.fields import FilePath, items, shown, text
from cvxlimit.io.forms import (
    FLAG,
    TEXT,
    Document,
    Form,
    Key,
    by_type,
    choice,
    keyed,
    listed,
    nullable,
    record,
)
from cvxlimit.io.results import FIGURE, RATES, RESULT, TOLERANCE
from cvxlimit.io.scenes import LOAD
from cvxlimit.solution import Status

VECTOR = listed(FIGURE, made=lambda numbers: np.array(numbers, dtype=float))
_FORMS: dict[str, Form] = {
    "point": nullable(VECTOR), "ray": nullable(VECTOR), "loaded": nullable(VECTOR),
    "offset": FIGURE, "solution": nullable(RESULT.inside), "direction": VECTOR, "normal": VECTOR,
    "rates": nullable(RATES),
}  # fmt: skip
SUPPORT = record(
    Support,
    {
        name: Key(_FORMS.get(name, FLAG), is_needed=name != "rates")
        for name in map(str, Support.__dataclass_fields__)
    },
)


def _named(value: Any, where: str, _: str) -> dict[str, Any]:
    each = [items(entry, where) for entry in items(value, where)]
    for entry in each:
        if len(entry) != 2:
            raise InputError(f"each of {where} must be a name and a load, got {shown(entry)}")
    names = [text(name, f"name of a load in {where}") for name, _ in each]
    loads = [LOAD.read(load, f"a load in {where}", where) for _, load in each]
    if (twice := first_twice(names)) is not None or not 2 <= len(names) <= 3:
        what = f"{len(names)} loads" if twice is None else f"{shown(twice)} twice"
        raise InputError(f"{where} must be two or three by different names, got {what}")
    return dict(zip(names, loads, strict=True))


LOADS = Form(
    _named,
    lambda loads, where, owner: [
        [name, LOAD.write(load, f"load {name!r}", where)] for name, load in loads.items()
    ],
    {"type": "array", "items": {"type": "array"}},
)
"""Pairs of a name and a load: their order is that of the load factors."""


def _domain(status: str, loads: dict[str, Any], units: Any, **given: Any) -> LoadDomain:
    """A domain all of whose vectors have a number for each load."""
    _check_vector(units, len(loads), "units")
    if not (units > 0.0).all():
        raise InputError(f"units must be above zero, got {shown(units.tolist())}")
    for i, support in enumerate(given["supports"]):
        where = f"entry {i} of supports"
        for name in ("direction", "point", "ray", "normal", "loaded"):
            vector = getattr(support, name)
            if vector is not None:
                _check_vector(vector, len(loads), f"{name} of {where}")
        if support.solution is not None and not support.solution.history:
            raise InputError(f"history of the solution in {where} must not be empty")
        if np.isnan(support.offset):
            raise InputError(f"offset of {where} must be a number, got 'nan'")
    return LoadDomain(status=Status(status), loads=loads, units=units, **given)


def _check_vector(vector: Any, size: int, where: str) -> None:
    if len(vector) != size or not np.isfinite(vector).all():
        raise InputError(
            f"{where} must be {size} finite numbers, one for each load, got "
            f"{shown(vector.tolist())}: the file is damaged; delete it, or take another"
        )


_KEYS: dict[str, Key | Form] = {
    "scene": Key(TEXT, field="scene_name"),
    **dict.fromkeys(("surface", "method"), TEXT),
    "loads": LOADS,
    "units": VECTOR,
    "supports": listed(SUPPORT),
    "status": choice(Status),
    "tolerance": TOLERANCE,
    "is_convex": Key(FLAG, is_needed=True),
    **by_type(LoadDomain, FIGURE, "solves", "seconds", "about", "scene_digest"),
    "versions": keyed(TEXT, "version of {key}"),
}

DOMAIN = Document("domain", LoadDomain, "domain", "load_domain(scene) makes one", _KEYS, _domain)


def read_domain(path: FilePath) -> LoadDomain:
    """Read a file written by :func:`write_domain`.

    Raises
    ------
    InputError
        If the file cannot be read or is no valid domain.
    """
    return DOMAIN.read(path)


def write_domain(domain: LoadDomain, path: FilePath) -> None:
    """Write a domain with all its solutions as JSON; the file is complete or untouched.

    Raises
    ------
    InputError
        If it is no load domain, or the file cannot be written.
    """
    DOMAIN.write(domain, path)

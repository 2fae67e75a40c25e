"""Files of load domains: ``cvxlimit-domain``, version 1."""

from __future__ import annotations

from typing import Any

import numpy as np

from cvxlimit.io.fields import Path, items, text
from cvxlimit.io.forms import (
    HEADER,
    TEXT,
    WHOLE,
    Document,
    Form,
    Key,
    choice,
    listed,
    nullable,
    plain,
    record,
)
from cvxlimit.io.results import FIGURE, RESULT
from cvxlimit.io.scenes import LOAD
from cvxlimit.solution import Status
from cvxlimit.studies.domains.domain import LoadDomain
from cvxlimit.studies.domains.supports import Support


def _truth(value: Any, where: str) -> bool:
    return choice(("yes", "no")).read(value, where, "") == "yes"


FLAG = plain(_truth, {"enum": ["yes", "no"]}, lambda value, _: "yes" if value else "no")
VECTOR = listed(FIGURE, made=lambda numbers: np.array(numbers, dtype=float))
SOLUTION = Form(
    lambda value, *_: RESULT.from_dict(value),
    lambda value, *_: RESULT.to_dict(value),
    RESULT.schema,
)
_FORMS: dict[str, Form] = {
    "point": nullable(VECTOR), "ray": nullable(VECTOR), "loaded": nullable(VECTOR),
    "offset": FIGURE, "solution": nullable(SOLUTION), "direction": VECTOR, "normal": VECTOR,
}  # fmt: skip
SUPPORT = record(
    Support,
    {
        name: Key(_FORMS.get(name, FLAG), is_needed=True)
        for name in map(str, Support.__dataclass_fields__)
    },
)


def _named(value: Any, where: str, owner: str) -> dict[str, Any]:
    each = [items(entry, where) for entry in items(value, where)]
    names = [text(name, f"name of a load in {where}") for name, _ in each]
    loads = [LOAD.read(load, f"a load in {where}", where) for _, load in each]
    return dict(zip(names, loads, strict=True))


LOADS = Form(
    _named,
    lambda loads, where, owner: [
        [name, LOAD.write(load, f"load {name!r}", where)] for name, load in loads.items()
    ],
    {"type": "array", "items": {"type": "array"}},
)
"""Pairs of a name and a load: their order is that of the load factors."""

DOMAIN: Document[LoadDomain] = Document(
    "domain",
    record(
        LoadDomain,
        {
            **{name: Key(TEXT, "{key}") for name in ("scene", "surface", "method")},
            "loads": Key(LOADS, "{key}"),
            "units": Key(VECTOR, "{key}"),
            "supports": Key(listed(SUPPORT), "{key}"),
            "status": Key(choice(Status), "{key}"),
            "tolerance": Key(FIGURE, "{key}"),
            "is_convex": Key(FLAG, "{key}", is_needed=True),
            "solves": Key(WHOLE, "{key}"),
            "seconds": Key(FIGURE, "{key}"),
            "about": Key(TEXT, "{key}"),
        },
        lambda status, **given: LoadDomain(status=Status(status), **given),
        header=HEADER,
    ),
)


def read_domain(path: Path) -> LoadDomain:
    """Read a file written by :func:`write_domain`.

    Raises
    ------
    InputError
        If the file cannot be read or is no valid domain.
    """
    found: LoadDomain = DOMAIN.read(path)
    return found


def write_domain(domain: LoadDomain, path: Path) -> None:
    """Write a domain with all its solutions as JSON; the file is complete or untouched."""
    DOMAIN.write(domain, path)

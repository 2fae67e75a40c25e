"""A table of boxes: CSV with one axis-aligned block per row."""

from __future__ import annotations

import csv
import io

import numpy as np

from cvxlimit.checks import first_twice
from cvxlimit.errors import InputError
from cvxlimit.io.fields import shown
from cvxlimit.io.geometry.bodies import Body

CORNERS = ("xmin", "ymin", "zmin", "xmax", "ymax", "zmax")
OPTIONAL = ("density", "support")


def read_table(text: str) -> list[Body]:
    try:
        dialect: type[csv.Dialect] = csv.Sniffer().sniff(text.split("\n", 1)[0], ",;\t")
    except csv.Error:
        dialect = csv.excel
    try:
        rows = list(csv.reader(io.StringIO(text), dialect, strict=True))
    except csv.Error as error:
        raise InputError(f"no table: {error}") from error
    names = [name.strip().lower() for name in rows[0]] if rows else []
    _check_columns(names)
    return [
        _box(dict(zip(names, [cell.strip() for cell in row], strict=True)), line)
        for line, row in enumerate(rows[1:], 2)
        if _is_row(row, names, line)
    ]


def _check_columns(names: list[str]) -> None:
    known = ("id", *CORNERS, *OPTIONAL)
    missing = [name for name in ("id", *CORNERS) if name not in names]
    if missing:
        raise InputError(
            f"the table lacks the column {missing[0]!r}; its first row must name id, "
            f"{', '.join(CORNERS)} and may name {', '.join(OPTIONAL)}"
        )
    strange = [name for name in names if name not in known]
    if strange:
        raise InputError(
            f"the table has an unknown column {shown(strange[0])}; known ones are "
            f"{', '.join(known)}"
        )
    if (twice := first_twice(names)) is not None:
        raise InputError(f"column {twice!r} is named twice; keep one of them")


def _is_row(row: list[str], names: list[str], line: int) -> bool:
    if not any(cell.strip() for cell in row):
        return False
    if len(row) != len(names):
        raise InputError(f"line {line} has {len(row)} cells, the first line {len(names)}")
    return True


def _box(cells: dict[str, str], line: int) -> Body:
    name = cells["id"]
    if not name:
        raise InputError(f"line {line} has no id; give every block a name")
    where = f"block {shown(name)}"
    corners = np.array([_number(cells[key], f"{key} of {where}") for key in CORNERS])
    support = None
    if "support" in cells:
        answer = cells["support"].lower()
        support = answer in ("1", "yes", "true", "y", "x")
        if not support and answer not in ("0", "no", "false", "n", ""):
            raise InputError(f"support of {where} must be yes or no, got {shown(answer)}")
    density = cells.get("density", "")
    stated = _number(density, f"density of {where}") if density else None
    return Body(name, corners.reshape(2, 3), (), support, stated, is_box=True)


def _number(cell: str, where: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise InputError(f"{where} must be a number, got {shown(cell)}") from error

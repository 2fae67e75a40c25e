"""A table of boxes: CSV with one axis-aligned block per row.

Where cells are parted by semicolons or tabs, numbers may have decimal commas: all of them or none.
"""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np

from cvxlimit.base.checks import first_twice
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body
from cvxlimit.io.fields import decoded, read_bytes, shown

CORNERS = ("xmin", "ymin", "zmin", "xmax", "ymax", "zmax")
OPTIONAL = ("density", "support")


def read_table(path: Path, notes: list[str]) -> list[Body]:
    """The boxes of a table, whose first row names the columns; cells are parted by what is found
    in that row: commas, semicolons or tabs."""
    text = decoded(read_bytes(path))
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
    cells = {
        line: dict(zip(names, [cell.strip() for cell in row], strict=True))
        for line, row in enumerate(rows[1:], 2)
        if _is_row(row, names, line, dialect.delimiter)
    }
    if dialect.delimiter != ",":
        _without_decimal_commas(cells)
    return [_box(row, line) for line, row in cells.items()]


def _without_decimal_commas(cells: dict[int, dict[str, str]]) -> None:
    """Turn decimal commas into points; refused where a comma may be something else."""
    numbers = [
        (line, key, row[key])
        for line, row in cells.items()
        for key in (*CORNERS, "density")
        if row.get(key)
    ]
    commas = [(line, key, cell) for line, key, cell in numbers if "," in cell]
    points = [cell for _, _, cell in numbers if "." in cell]
    if not commas:
        return
    line, key, cell = commas[0]
    if points:
        raise InputError(
            f"line {line} has {key} {shown(cell)} with a comma, and {shown(points[0])} stands in "
            "the same table with a point: write all numbers with one of them"
        )
    if all(_THOUSANDS.fullmatch(cell) for _, _, cell in commas):
        raise InputError(
            f"line {line} has {key} {shown(cell)}: every comma of the table may part thousands as "
            "well as decimals; write the numbers with points, or without thousands"
        )
    for line, key, cell in commas:
        cells[line][key] = cell.replace(",", ".")


_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


def _check_columns(names: list[str]) -> None:
    """Refuse missing, unknown and repeated columns: an unknown one may be meant for a known one."""
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


def _is_row(row: list[str], names: list[str], line: int, delimiter: str) -> bool:
    """False for an empty line; refused if it has more or fewer cells than there are columns."""
    if not any(cell.strip() for cell in row):
        return False
    if len(row) != len(names):
        commas = delimiter == "," and len(row) > len(names)
        cure = "; with decimal commas, part the cells by semicolons" if commas else ""
        raise InputError(f"line {line} has {len(row)} cells, the first line {len(names)}{cure}")
    return True


def _box(cells: dict[str, str], line: int) -> Body:
    """The block in a row; support mark and density are None if the table has no such column, or no
    density in this row."""
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
    """A cell as a number; that coordinates are finite is checked later, as of any format."""
    try:
        return float(cell)
    except ValueError as error:
        raise InputError(f"{where} must be a number, got {shown(cell)}") from error

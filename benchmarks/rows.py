"""Rows on disk, one JSON object a line: a run that was interrupted goes on where it stopped."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cvxlimit.base.files import write_file

Row = dict[str, Any]


class Rows:
    """The rows of a file, told apart by the columns named; of several alike the last counts.

    Example
    -------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "study.jsonl"
    >>> Rows(file, "scene").add({"scene": "a", "value": 1.0})
    >>> {"scene": "a"} in Rows(file, "scene"), {"scene": "b"} in Rows(file, "scene")
    (True, False)
    """

    def __init__(self, path: Path, *names: str) -> None:
        self.path, self.names = path, names
        self._rows: dict[tuple[object, ...], Row] = {}
        lines = path.read_text("utf-8").split("\n") if path.exists() else []
        if lines and lines.pop():  # what follows the last end of line was being written
            write_file(path, "".join(f"{line}\n" for line in lines).encode("utf-8"))
        for row in map(json.loads, lines):
            self._rows[self._key(row)] = row

    def _key(self, row: Mapping[str, Any]) -> tuple[object, ...]:
        return tuple(row[name] for name in self.names)

    def __contains__(self, row: Mapping[str, Any]) -> bool:
        return self._key(row) in self._rows

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows.values())

    def __len__(self) -> int:
        return len(self._rows)

    def get(self, row: Mapping[str, Any]) -> Row | None:
        """The row of the same columns."""
        return self._rows.get(self._key(row))

    def add(self, row: Mapping[str, Any]) -> None:
        """Keep a row, at once. JSON has no infinity: such numbers are null."""
        plain = {name: _plain(value) for name, value in row.items()}
        self._rows[self._key(plain)] = plain
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(plain) + "\n")


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value

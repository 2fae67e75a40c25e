"""Rows on disk, one JSON object a line: a run that was interrupted goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import cvxlimit
from cvxlimit.base.files import write_file
from cvxlimit.base.versions import __version__

Row = dict[str, Any]


@cache
def code() -> str:
    """Tells sources apart, of the package and of what measures it."""
    roots = Path(cvxlimit.__file__).parent, Path(__file__).parent
    files = sorted(f for root in roots for f in root.rglob("*") if f.suffix in (".py", ".c"))
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()[:12]


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


class Measured(Rows):
    """Rows that name the code which measured them: of other code they count as not measured, and
    leave the file when the first new row comes.

    With ``kept`` the rows of a file are read, whoever measured them, and none is added;
    :meth:`said` tells whose they are.

    Example
    -------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "study.jsonl"
    >>> Measured(file, "scene").add({"scene": "a", "value": 1.0})
    >>> list(Measured(file, "scene"))
    [{'scene': 'a', 'value': 1.0}]
    """

    def __init__(self, path: Path, *names: str, kept: bool = False) -> None:
        if kept and not path.exists():
            raise SystemExit(f"there are no rows kept in {path}")
        super().__init__(path, *names)
        made = {key: row.pop("made", {}) for key, row in self._rows.items()}
        self.whose = {f"{m.get('version', '?')} on {m.get('on', '?')}": None for m in made.values()}
        self._is_stale = False
        for key, each in () if kept else made.items():
            if each.get("code") != code():
                del self._rows[key]
                self._is_stale = True

    def add(self, row: Mapping[str, Any]) -> None:
        """Keep a row, with the code, version and day that it is of."""
        if self._is_stale:
            self.path.unlink()
            old, self._rows, self._is_stale = list(self), {}, False
            for each in old:
                self.add(each)
        made = {"code": code(), "version": __version__, "on": date.today().isoformat()}
        super().add({**row, "made": made})
        self._rows[self._key(row)].pop("made")

    def said(self) -> str:
        """Where rows are from that are not measured now."""
        whose = ", ".join(self.whose) or "nothing"
        return f"kept in {self.path}, measured with cvxlimit {whose}; nothing is measured now"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value

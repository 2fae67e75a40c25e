"""Results on disk, one JSON object a line: a run that was interrupted goes on where it stopped."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from cvxlimit.base.files import write_file

FOLDER = Path(__file__).parents[1] / "results" / "stability"
EVERY = 25
"""Records between two writings of a file: it is written whole each time, so that it is never half
a record long."""

Record = dict[str, Any]


class Table:
    """The records of one study, by key.

    Parameters
    ----------
    name : str
        File name without its suffix.
    folder : Path

    Example
    -------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with Table("study", folder) as table:
    ...     table.add("a", {"value": 1.0})
    >>> Table("study", folder).records
    {'a': {'value': 1.0}}
    """

    def __init__(self, name: str, folder: Path = FOLDER) -> None:
        self.path = folder / f"{name}.jsonl"
        self.records: dict[str, Record] = dict(_read(self.path))
        self._unsaved = 0

    def __enter__(self) -> Table:
        return self

    def __exit__(self, *error: object) -> None:
        self.save()

    def __contains__(self, key: str) -> bool:
        return key in self.records

    def add(self, key: str, record: Record) -> None:
        """Keep a record; every :data:`EVERY` of them the file is written."""
        self.records[key] = {name: _plain(value) for name, value in record.items()}
        self._unsaved += 1
        if self._unsaved >= EVERY:
            self.save()

    def save(self) -> None:
        """Write the file, in one step."""
        if self._unsaved:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_file(self.path, "".join(_lines(self.records.items())).encode("utf-8"))
            self._unsaved = 0

    def rows(self) -> list[Record]:
        """All records, each with its key."""
        return [{"key": key, **record} for key, record in self.records.items()]


def _plain(value: Any) -> Any:
    """JSON has no infinity."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _lines(records: Iterable[tuple[str, Record]]) -> Iterator[str]:
    for key, record in records:
        yield json.dumps({"key": key, **record}) + "\n"


def _read(path: Path) -> Iterator[tuple[str, Record]]:
    if path.exists():
        for line in path.read_text("utf-8").splitlines():
            record = json.loads(line)
            yield record.pop("key"), record

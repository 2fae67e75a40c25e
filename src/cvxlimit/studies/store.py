"""Results of a sweep on disk: a folder of Parquet files that grows as they come."""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvxlimit.errors import InputError
from cvxlimit.extras import needed
from cvxlimit.files import write_file

if TYPE_CHECKING:
    from pandas import DataFrame

KEY = "variation"
"""Column that names a variation: a digest of its parameters."""

_ABOUT = "sweep.json"
_SECONDS = 1.0
"""Rows wait this long at most before they are written: a file takes 5 ms."""


def key_of(variation: Mapping[str, Any]) -> str:
    """A short name of a variation, the same wherever and whenever it is asked for.

    Raises
    ------
    InputError
        If a parameter is neither a number nor a text.
    """
    try:
        text = json.dumps({k: _plain(v) for k, v in variation.items()}, sort_keys=True)
    except TypeError as error:
        raise InputError(
            f"only numbers and texts can be stored as parameters, got {dict(variation)!r:.120}: "
            "vary a name, and look up in the factory what it stands for"
        ) from error
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's; whole numbers as those of a column with fractions."""
    value = value.item() if hasattr(value, "item") else value
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


class Store:
    """A folder with the rows of one sweep.

    Parameters
    ----------
    path : path
        Made if it does not exist.
    about : mapping
        What the sweep is; a folder that was made for another one is refused.

    Raises
    ------
    InputError
        If the folder cannot be written to, or holds another sweep.
    ModelError
        If pandas or pyarrow is not installed.
    """

    def __init__(self, path: str | os.PathLike[str], about: Mapping[str, str]) -> None:
        needed("pyarrow", "frames", "Parquet files")
        self.folder = Path(path)
        self._waiting: list[Mapping[str, Any]] = []
        self._written = 0.0
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: results cannot be stored there: {error.strerror}") from error
        self._check(about)

    def _check(self, about: Mapping[str, str]) -> None:
        note = self.folder / _ABOUT
        if not note.exists():
            if any(self.folder.iterdir()):
                raise InputError(f"{self.folder}: the folder holds something else than a sweep")
            write_file(note, json.dumps(dict(about), indent=1).encode())
            return
        found = json.loads(note.read_text("utf-8"))
        for what, value in about.items():
            if found.get(what) != value:
                raise InputError(
                    f"{self.folder}: holds a sweep of another {what} ({found.get(what)!r:.60} in "
                    f"place of {value!r:.60}): take another folder, or delete this one"
                )

    def rows(self) -> DataFrame:
        """All rows that are stored, each variation once."""
        return read_sweep(self.folder)

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Take rows; they are on disk a second later, or when :meth:`flush` is called."""
        self._waiting.extend(rows)
        if time.monotonic() - self._written > _SECONDS:
            self.flush()

    def flush(self) -> None:
        """Write what waits, into a file that appears complete or not at all."""
        if not self._waiting:
            return
        pandas = needed("pandas", "frames", "sweeps")
        buffer = io.BytesIO()
        pandas.DataFrame(self._waiting).to_parquet(buffer, index=False)
        name = hashlib.blake2b(buffer.getvalue(), digest_size=6).hexdigest()
        number = sum(1 for _ in self.folder.glob("part-*.parquet"))
        write_file(self.folder / f"part-{number:06}-{name}.parquet", buffer.getvalue())
        self._waiting, self._written = [], time.monotonic()


def read_sweep(path: str | os.PathLike[str]) -> DataFrame:
    """The rows that a sweep has stored in a folder so far, each variation once.

    Raises
    ------
    InputError
        If the folder holds no sweep.
    ModelError
        If pandas or pyarrow is not installed.
    """
    pandas = needed("pandas", "frames", "sweeps")
    needed("pyarrow", "frames", "Parquet files")
    folder = Path(path)
    if not (folder / _ABOUT).exists():
        raise InputError(f"{path}: holds no sweep: sweep(..., path={str(path)!r}) makes one")
    parts = [pandas.read_parquet(part) for part in sorted(folder.glob("part-*.parquet"))]
    if not parts:
        return pandas.DataFrame({KEY: []})
    joined = pandas.concat(parts, ignore_index=True)
    result: DataFrame = joined.drop_duplicates(KEY, ignore_index=True)
    return result

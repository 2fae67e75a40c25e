"""The rows of a sweep on disk: a folder of Parquet files that grows while it runs."""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvxlimit.errors import InputError
from cvxlimit.extras import needed
from cvxlimit.files import write_file

if TYPE_CHECKING:
    from pandas import DataFrame

KEY = "variation"
"""Column that names a variation: a digest of its parameters."""

_ABOUT, _OLD_ABOUT = "_sweep.json", "sweep.json"
"""What the sweep is of; readers of Parquet folders leave out names that begin with _."""


def key_of(variation: Mapping[str, Any]) -> str:
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
    """A folder with the rows of one sweep; ``about`` says of which, and another's is refused."""

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
        note = _note(self.folder)
        if note is None:
            if any(self.folder.iterdir()):
                raise InputError(f"{self.folder}: the folder holds something else than a sweep")
            write_file(self.folder / _ABOUT, json.dumps(dict(about), indent=1).encode())
            return
        found = json.loads(note.read_text("utf-8"))
        for what, value in about.items():
            if found.get(what) != value:
                raise InputError(
                    f"{self.folder}: holds a sweep of another {what} ({found.get(what)!r:.60} in "
                    f"place of {value!r:.60}): take another folder, or delete this one"
                )

    def known(self, names: set[str]) -> dict[str, dict[str, Any]]:
        rows = read_sweep(self.folder).to_dict("records")
        return {row[KEY]: row for row in rows if row[KEY] in names}

    def add(self, row: Mapping[str, Any]) -> None:
        self._waiting.append(row)
        if time.monotonic() - self._written > 1.0:  # a file takes 5 ms
            self.flush()

    def flush(self) -> None:
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

    ``pandas.read_parquet`` reads the folder as well, with a variation twice that two processes
    happened to store.

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
    if _note(folder) is None:
        raise InputError(f"{path}: holds no sweep: sweep(..., path={str(path)!r}) makes one")
    parts = [pandas.read_parquet(part) for part in sorted(folder.glob("part-*.parquet"))]
    if not parts:
        return pandas.DataFrame({KEY: []})
    joined = pandas.concat(parts, ignore_index=True)
    result: DataFrame = joined.drop_duplicates(KEY, ignore_index=True)
    return result


def _note(folder: Path) -> Path | None:
    notes = (folder / name for name in (_ABOUT, _OLD_ABOUT))
    return next((note for note in notes if note.exists()), None)

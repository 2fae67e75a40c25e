"""The rows of a sweep on disk: a folder of Parquet files that grows while it runs.

``_sweep.json`` says what is asked, and by which version. Every ``part-...parquet`` holds rows, and
the ``_proof-...parquet`` of its name the solutions that they come from. A row is known by its
identity (:mod:`cvxlimit.extensions.studies.identity`). Files are complete or absent, and leftovers
of a process that was killed, whose names begin with a dot, are nobody's.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cvxlimit.base.extras import needed
from cvxlimit.base.files import write_file, write_new_file
from cvxlimit.base.versions import __version__
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.identity import check_version
from cvxlimit.io.fields import mapping, read_document, refusals

if TYPE_CHECKING:
    from pandas import DataFrame

KEY = "variation"
"""Column that names a variation: a digest of its parameters."""

IDENTITY = "identity"
"""Column that names a row: a digest of all that it follows from."""

PROOF = "proof"
"""Of a row under way: the result file of its solution, as a text."""

_ABOUT, _OLD_ABOUT = "_sweep.json", "sweep.json"
"""What the sweep is of; readers of Parquet folders leave out names that begin with _."""


def key_of(variation: Mapping[str, Any]) -> str:
    """Returns the digest of a variation; raises InputError for values that cannot be stored."""
    try:
        text = json.dumps({k: _plain(v) for k, v in variation.items()}, sort_keys=True)
    except TypeError as error:
        raise InputError(
            f"only numbers and texts can be stored as parameters, got {dict(variation)!r:.120}: "
            "vary a name, and look up in the factory what it stands for"
        ) from error
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def _plain(value: Any) -> Any:
    """Returns NumPy's numbers as Python's, and whole numbers as floats, as columns may have
    them."""
    value = value.item() if hasattr(value, "item") else value
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


class Store:
    """A folder with the rows of one sweep; ``about`` says of which, and another's is refused.

    Several processes may start it and add to it at once. ``rows`` has what the folder held when
    this one began, by identity.
    """

    def __init__(self, path: str | os.PathLike[str], about: Mapping[str, Any]) -> None:
        needed("pyarrow", "frames", "Parquet files")
        self.folder = Path(path)
        self._waiting: list[dict[str, Any]] = []
        self._written = 0.0
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path}: results cannot be stored there: {error.strerror}") from error
        self._check({"version": __version__, **about})
        rows = read_sweep(self.folder, every=True).to_dict("records")
        if any(not isinstance(row.get(IDENTITY), str) for row in rows):
            raise InputError(
                f"{self.folder}: holds rows without the column {IDENTITY!r}, as earlier versions "
                "wrote them: take another folder, or delete this one"
            )
        self.rows: dict[str, dict[str, Any]] = {row[IDENTITY]: row for row in rows}
        self._last = {row[KEY]: row[IDENTITY] for row in rows}

    def _check(self, about: Mapping[str, Any]) -> None:
        if _note(self.folder) is None:
            others = [path.name for path in self.folder.iterdir() if path.name[:1] not in "._"]
            if others and _note(self.folder) is None:  # another process may have begun meanwhile
                raise InputError(
                    f"{self.folder}: the folder holds something else than a sweep "
                    f"({sorted(others)[0]!r}): take another folder"
                )
            write_new_file(self.folder / _ABOUT, json.dumps(dict(about), indent=1).encode())
        found = about_sweep(self.folder)
        cure = "folder, or delete this one (read_sweep still reads it)"
        check_version(self.folder, "rows", found.get("version"), cure)
        for what in ("scene", "options"):
            if found.get(what) != about[what]:
                raise InputError(
                    f"{self.folder}: holds a sweep of another {what} ({found.get(what)!r:.60} in "
                    f"place of {about[what]!r:.60}): take another folder, or delete this one"
                )

    def add(self, key: str, variation: Mapping[str, Any], row: Mapping[str, Any]) -> dict[str, Any]:
        """Keeps a row, with the text of its proof, as the last one of its variation; returns it,
        or the one of its identity that the folder held when the store was begun (``rows``), which
        is stored again only where another row of its variation came after it.

        What waits is written with the first row that comes more than a second after the last file,
        a file taking 5 ms; who adds no more has to :meth:`flush`.
        """
        identity = row[IDENTITY]
        is_last = self._last.get(key) == identity
        self._last[key] = identity
        kept = self.rows.get(identity)
        if kept is None or not is_last:
            found = dict(row if kept is None else kept)
            # The variation's own parameters come first, and count: a row that is known by its
            # identity may be that of another variation.
            self._waiting.append({KEY: key, **variation} | found | {**variation, KEY: key})
            if time.monotonic() - self._written > 1.0:
                self.flush()
        return dict(row) if kept is None else kept

    def flush(self) -> None:
        """Writes the rows that wait, with their proofs, to a file each."""
        if not self._waiting:
            return
        proofs = [{IDENTITY: r[IDENTITY], PROOF: r[PROOF]} for r in self._waiting if r.get(PROOF)]
        rows = [{k: x for k, x in row.items() if k != PROOF} for row in self._waiting]
        data = _parquet(rows)
        name = hashlib.blake2b(data, digest_size=6).hexdigest()
        number = sum(1 for _ in self.folder.glob("part-*.parquet"))
        stem = f"{number:06}-{name}.parquet"
        if proofs:  # first: a row that is there can be proved
            write_file(self.folder / f"_proof-{stem}", _parquet(proofs))
        write_file(self.folder / f"part-{stem}", data)
        self._waiting, self._written = [], time.monotonic()


def _parquet(rows: Sequence[Mapping[str, Any]]) -> bytes:
    """Returns rows as the bytes of a Parquet file."""
    buffer = io.BytesIO()
    pandas = needed("pandas", "frames", "sweeps")
    pandas.DataFrame(rows).to_parquet(buffer, index=False, compression="zstd")
    return buffer.getvalue()


def read_sweep(path: str | os.PathLike[str], *, every: bool = False) -> DataFrame:
    """Returns the rows that a sweep has stored in a folder so far, each variation once.

    Where a variation was solved again, because the function that builds its scene was edited or a
    surface of one's own changed, the last row counts; ``every`` gives all of them.
    ``pandas.read_parquet`` reads the folder as well, with all rows, and some of them twice where
    two processes happened to store them.

    Raises
    ------
    InputError
        If the folder holds no sweep, or a file in it is damaged.
    ModelError
        If pandas or pyarrow is not installed.
    """
    pandas = needed("pandas", "frames", "sweeps")
    folder = Path(path)
    about_sweep(folder)
    parts = [read_part(part) for part in sorted(folder.glob("part-*.parquet"))]
    if not parts:
        parts = [pandas.DataFrame({KEY: [], IDENTITY: []})]
    joined = pandas.concat(parts, ignore_index=True)
    names = [name for name in (KEY, IDENTITY) if every and name in joined.columns]
    kept: DataFrame = joined.drop_duplicates(names or KEY, keep="last", ignore_index=True)
    return kept


def read_part(part: Path) -> DataFrame:
    """Returns the rows of one file; raises InputError if it is damaged."""
    pandas = needed("pandas", "frames", "sweeps")
    needed("pyarrow", "frames", "Parquet files")
    is_proof = part.name.startswith("_")
    both = f" and {part.name.replace('_proof', 'part')}" if is_proof else ""
    cure = f"delete it{both}, and the same call solves its rows again"
    try:
        found: DataFrame = pandas.read_parquet(part, engine="pyarrow")
    except FileNotFoundError:
        raise
    except Exception as error:  # pyarrow has many kinds
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{part}: this part of a sweep is damaged ({reason}): {cure}") from error
    for wanted in (IDENTITY, PROOF) if is_proof else (KEY,):
        if wanted not in found.columns:
            raise InputError(f"{part}: this part of a sweep lacks the column {wanted!r}: {cure}")
    return found


def proofs_of(folder: Path) -> dict[str, str]:
    """Returns the texts of result files by the identity of their rows."""
    found = dict[str, str]()
    for part in sorted(folder.glob("part-*.parquet")):
        proof = folder / f"_proof-{part.name.removeprefix('part-')}"
        if proof.exists():
            rows = read_part(proof)
            found |= dict(zip(rows[IDENTITY], rows[PROOF], strict=True))
    return found


def about_sweep(folder: Path) -> dict[str, Any]:
    """Returns the description of the sweep that a folder holds.

    Raises
    ------
    InputError
        If it holds no sweep, or the file that says it is damaged.
    """
    note = _note(folder)
    if note is None:
        raise InputError(f"{folder}: holds no sweep: sweep(..., path={str(folder)!r}) makes one")
    with refusals(f"{note}: damaged, take another folder or delete this one: "):
        return mapping(read_document(note), "what says of which sweep the folder is")


def _note(folder: Path) -> Path | None:
    notes = (folder / name for name in (_ABOUT, _OLD_ABOUT))
    return next((note for note in notes if note.exists()), None)

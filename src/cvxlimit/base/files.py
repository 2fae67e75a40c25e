"""Writing files so that they appear complete or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from cvxlimit.errors import InputError


def write_file(path: str | os.PathLike[str], data: bytes) -> None:
    """Replace ``path`` by a file with ``data``, in one step; on failure it is left untouched.

    Links are followed, permissions of an existing file are kept, devices and pipes are written
    directly.
    """
    try:
        if os.path.exists(path) and not os.path.isfile(path):
            with open(path, "wb") as special:
                special.write(data)
        else:
            _replace(os.path.realpath(path), data)
    except (OSError, ValueError) as error:
        name = "".join(c if c.isprintable() else repr(c)[1:-1] for c in os.fsdecode(path))
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{name}: the file cannot be written: {reason}") from error


def write_new_file(path: str | os.PathLike[str], data: bytes) -> None:
    """A file with ``data``, in one step, unless there is one: of several processes one wins."""
    try:
        with _temporary(os.fspath(path), data) as temporary, suppress(FileExistsError):
            try:
                os.link(temporary, path)
            except FileExistsError:
                raise
            except OSError:  # a file system without links
                if not os.path.exists(path):
                    os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"{os.fspath(path)}: the file cannot be written: {error.strerror}"
        ) from error


def _replace(path: str, data: bytes) -> None:
    with _temporary(path, data) as temporary:
        if os.path.exists(path):
            shutil.copymode(path, temporary)
        os.replace(temporary, path)


@contextmanager
def _temporary(path: str, data: bytes) -> Iterator[str]:
    """A file with ``data`` in the folder of ``path``, on the disk itself, gone in the end."""
    temporary = os.path.join(os.path.dirname(path), f".cvxlimit-{secrets.token_hex(8)}.tmp")
    try:
        with open(temporary, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        yield temporary
    finally:
        with suppress(FileNotFoundError):
            os.unlink(temporary)

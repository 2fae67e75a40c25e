"""Files appear complete or not at all."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from cvxlimit.errors import InputError


def write_file(path: Path, content: bytes) -> None:
    """Write ``content`` beside ``path``, then move it there in one step.

    Raises
    ------
    InputError
        If the folder does not exist or cannot be written to, or ``path`` is a folder.
    """
    temporary = path.parent / f".cvxlimit-{secrets.token_hex(8)}.tmp"
    try:
        with temporary.open("xb") as file:
            file.write(content)
        os.replace(temporary, path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot write {str(path)!r}: {reason}") from error
    finally:
        temporary.unlink(missing_ok=True)

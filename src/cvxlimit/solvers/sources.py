"""What the compiled parts were made of. ``hatch_build.py`` runs this file by itself.

A digest of its C is compiled into every part and compared when it is loaded: a part that was built
from other sources may take other arguments, and is left alone.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

HERE = Path(__file__).parent
"""Where the headers are that all parts share."""


def digest(source: Path, headers: Path = HERE) -> str:
    """Returns a digest of a C file with the shared headers, however its lines end; empty where the
    file is not there."""
    if not source.exists():
        return ""
    texts = [
        path.read_bytes().replace(b"\r\n", b"\n") for path in (*sorted(headers.glob("*.h")), source)
    ]
    return hashlib.sha256(b"\0".join(texts)).hexdigest()[:16]

"""What the compiled parts were made of. ``hatch_build.py`` runs this file by itself.

A digest of all C is compiled into every part and compared when it is loaded: a part that was built
from other sources may take other arguments, and is left alone.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

HERE = Path(__file__).parent


def digest(folder: Path = HERE) -> str:
    """Returns a digest of the C below a folder, however its lines end; empty where there is
    none."""
    files = sorted(path for ending in ("c", "h") for path in folder.glob(f"**/*.{ending}"))
    texts = [path.read_bytes().replace(b"\r\n", b"\n") for path in files]
    return hashlib.sha256(b"\0".join(texts)).hexdigest()[:16] if texts else ""

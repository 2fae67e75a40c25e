"""What kind of picture a file's name asks for."""

from __future__ import annotations

import os
from pathlib import Path

from cvxlimit.errors import InputError

IMAGES = (".png", ".svg", ".pdf")
"""Files of figures. In SVG and PDF the painted blocks are an image; everything else is lines."""


def with_suffix(path: str | os.PathLike[str], suffixes: tuple[str, ...]) -> Path:
    """The path, if its name ends as it should.

    Raises
    ------
    InputError
    """
    target = Path(path)
    if target.suffix.lower() not in suffixes:
        raise InputError(
            f"cannot tell what to draw from {target.name!r}: give a name that ends in "
            f"{' or '.join(suffixes)}"
        )
    return target

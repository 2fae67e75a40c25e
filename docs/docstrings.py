"""Docstrings as they are written here, for Sphinx."""

from __future__ import annotations

import re
from typing import Any

from numpydoc.docscrape import NumpyDocString
from sphinx.application import Sphinx


def signature(
    app: Sphinx, what: str, name: str, thing: object, options: object, text: str | None, result: Any
) -> tuple[str | None, str | None]:
    """Array types and functions by their names."""
    return text and named(text), result and named(result)


def named(text: str) -> str:
    """``Name`` for ``TypeAliasForwardRef('Name')``, ``f`` for ``<function f at 0x1>``."""
    return re.sub(r"TypeAliasForwardRef\('(\w+)'\)|<function (\w+)(?: at \w+)?>", r"\1\2", text)


def example(
    app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]
) -> None:
    """One example has a heading in the singular, which numpydoc would leave out."""
    for i, line in enumerate(lines[:-1]):
        if line == "Example" and lines[i + 1] == "-------":
            lines[i : i + 2] = ["Examples", "--------"]


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    NumpyDocString.sections["Example"] = ""
    app.connect("autodoc-process-signature", signature)
    app.connect("autodoc-process-docstring", example, priority=1)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

"""Docstrings as they are written here, for Sphinx: what napoleon would misread is put right."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.python import PyObject
from sphinx.ext.napoleon.docstring import NumpyDocstring


def prose(self: Any) -> list[str]:
    """A property's docstring is read like a method's: a colon in its first line ends no type."""
    self._what = "method"
    self._parse()  # adds its lines itself
    return []


def attributes(self: Any, section: str) -> list[str]:
    """Attributes are read like parameters: several names may share a line."""
    lines: list[str] = []
    for name, kind, description in self._consume_fields(multiple=True):
        lines += self._format_block(f":ivar {name}: ", description)
        if kind:
            lines.append(f":vartype {name}: {kind}")
    return [*lines, ""]


def signature(
    app: Sphinx, what: str, name: str, thing: object, options: object, text: str | None, result: Any
) -> tuple[str | None, str | None]:
    """Names of array types as they are written."""
    return named(text), named(result)


def named(text: str | None) -> str | None:
    """``FloatArray`` for ``TypeAliasForwardRef('FloatArray')``."""
    return text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("autodoc-process-signature", signature)
    NumpyDocstring._parse_attribute_docstring = prose
    NumpyDocstring._parse_attributes_section = attributes
    for field in PyObject.doc_field_types:
        if field.name == "variable":
            field.label = "Attributes"
    return {"parallel_read_safe": True, "parallel_write_safe": True}

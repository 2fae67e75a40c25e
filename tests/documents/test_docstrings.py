"""Every public name has a docstring of its own or of the method it overrides.

Public is what the pages of docs/api name. Linters cannot tell that from what is internal.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from words import INSTEAD

API = Path(__file__).parents[2] / "docs" / "api"
DIRECTIVE = re.compile(r"^\.\. (?:currentmodule|auto(\w+)):: (\S+)", re.MULTILINE)


def documented() -> Iterator[tuple[str, Any]]:
    """Names and objects that the pages of docs/api list."""
    for page in sorted(API.glob("*.md")):
        within = ""
        for kind, name in DIRECTIVE.findall(page.read_text("utf-8")):
            if not kind:
                within = f"{name}."
            elif kind == "module":
                yield from members(name)
            else:
                yield from reached(within + name if not name.startswith("cvxlimit") else name)


def members(module: str) -> Iterator[tuple[str, Any]]:
    found = import_module(module)
    yield module, found
    own = [n for n, thing in vars(found).items() if getattr(thing, "__module__", "") == module]
    for name in getattr(found, "__all__", own):
        if not name.startswith("_"):
            yield f"{module}.{name}", getattr(found, name)


def reached(path: str) -> Iterator[tuple[str, Any]]:
    """The object at a dotted path, whose first parts are modules."""
    first, *rest = path.split(".")
    thing: Any = import_module(first)
    for part in rest:
        inner = getattr(thing, part, None)
        thing = import_module(f"{thing.__name__}.{part}") if inner is None else inner
    yield path, thing


PUBLIC = dict(documented())


def undocumented(name: str, thing: Any) -> list[str]:
    """This name and those of its public methods and properties that say nothing."""
    silent = [] if not callable(thing) or inspect.getdoc(thing) else [name]
    if not inspect.isclass(thing):
        return silent
    own = [
        attribute
        for attribute, value in vars(thing).items()
        if not attribute.startswith("_")
        and (inspect.isroutine(value) or isinstance(value, (property, classmethod, staticmethod)))
    ]
    return silent + [f"{name}.{a}" for a in own if not inspect.getdoc(getattr(thing, a))]


def test_public_names_say_what_they_are() -> None:
    silent = [missing for name in PUBLIC for missing in undocumented(name, PUBLIC[name])]
    assert silent == []


def test_docstrings_are_written_as_pages_are() -> None:
    """Whatever a name inherits from other packages is theirs."""
    own = {n: inspect.getdoc(t) or "" for n, t in PUBLIC.items() if "cvxlimit" in f"{t!r}"}
    found = [(n, words) for n, text in own.items() for words in INSTEAD if re.search(words, text)]
    assert found == []


def test_the_check_knows_the_interface_and_can_fail() -> None:
    assert {"cvxlimit.Scene", "cvxlimit.solve", "cvxlimit.io.read_scene"} <= set(PUBLIC)

    class Silent:
        def method(self) -> None: ...

    Silent.__doc__ = None
    assert undocumented("Silent", Silent) == ["Silent", "Silent.method"]

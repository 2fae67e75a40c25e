"""What a stored answer is of: one digest of its scene, its surfaces, settings and version.

Names and texts do not tell an edited function from what it was, nor an object from another one of
its class. So scenes count with all that their files have, and everything else with its content:
numbers by value, objects by their class and state, functions and classes of one's own by their code
and what it refers to, those of libraries by their names and versions. What has no content to
compare cannot be told apart, and is refused.
"""

from __future__ import annotations

import dis
import hashlib
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Set
from concurrent.futures import Executor
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import cvxpy as cp
import numpy as np

from cvxlimit.base.versions import __version__
from cvxlimit.errors import InputError, ModelError
from cvxlimit.io.scenes import scene_digest
from cvxlimit.scene import Scene

_SIZE = 16
"""Bytes of a digest: two of a billion rows are alike by chance once in 10^20 folders."""

_ROUTINE = {
    "__dict__", "__weakref__", "__doc__", "__module__", "__qualname__", "__annotations__",
    "__annotate__", "__annotate_func__", "__annotations_cache__", "__static_attributes__",
    "__firstlineno__", "__abstractmethods__", "_abc_impl", "__parameters__", "__orig_bases__",
    "__dataclass_fields__", "__dataclass_params__", "__match_args__", "__hash__",
}  # fmt: skip
"""What a class has without saying what it does."""


def digest(value: object, what: str) -> str:
    """A digest of what a value is made of, the same in every process; ``what`` names it.

    Raises
    ------
    ModelError
        If it holds something whose content cannot be read: a lock, a file, a generator.

    Example
    -------
    >>> def below(limit):
    ...     return lambda x: x < limit
    >>> digest(below(2.0), "measure") == digest(below(3.0), "measure")
    False
    """
    content = _Content(what)
    content.add(value)
    return content.hexdigest()


def row_identity(asked: str, scene: Scene, varied: Mapping[str, Any]) -> str:
    """The identity of one answer: ``asked`` is the digest of all that does not vary, ``varied`` are
    further settings."""
    content = _Content("the row")
    content.add([__version__, asked, dict(varied)])
    content.add_scene(scene)
    return content.hexdigest()


def check_version(place: object, holds: str, wrote: object, cure: str) -> None:
    """Raises InputError for answers in a place that another version of cvxlimit wrote."""
    if wrote != __version__:
        by = "an earlier version" if wrote is None else f"version {wrote!r:.20}"
        raise InputError(
            f"{place}: holds {holds} of {by} of cvxlimit, this is {__version__}: take another "
            f"{cure}"
        )


class _Content:
    """A digest that grows by values, whatever they are; order and kinds count."""

    def __init__(self, what: str) -> None:
        self.what, self.hash = what, hashlib.blake2b(digest_size=_SIZE)
        self.seen: dict[int, int] = {}  # functions, classes and modules, which may be in circles
        self.kept: list[object] = []  # so that no other object gets the number of one seen
        self.around: list[object] = []  # containers and objects that the present one is in

    def hexdigest(self) -> str:
        return self.hash.hexdigest()

    def tag(self, *parts: object) -> None:
        for part in parts:
            data = part if isinstance(part, bytes) else repr(part).encode("utf-8")
            self.hash.update(len(data).to_bytes(8, "little"))
            self.hash.update(data)

    def add_scene(self, scene: Scene) -> None:
        self.tag("scene", scene_digest(scene))
        given = scene.__dict__.get("_given_contacts")
        if given is not None:  # of which files know nothing
            self.add([getattr(given, each.name) for each in fields(given)])

    def add(self, value: Any) -> None:
        """One value, by its kind."""
        match value:
            case None | bool() | str() | bytes():
                self.tag(type(value).__name__, value)
            case int() if abs(value) > 2**53:
                self.tag("whole", int(value))
            case int() | float() | np.integer() | np.floating():
                self.tag("number", (float(value) + 0.0).hex())
            case np.ndarray() if value.dtype != object:
                self.tag("array", value.dtype.str, value.shape, value.tobytes())
            case Scene():
                self.add_scene(value)
            case cp.Expression():
                self.add(value.value)
            case Executor():
                self.tag("executor")  # where something runs does not say what comes out
            case ModuleType():
                self._once(value, self._add_module)
            case type():
                self._once(value, self._add_class)
            case FunctionType():
                self._once(value, self._add_function)
            case CodeType():
                self._add_code(value)
            case list() | tuple() | np.ndarray() | set() | frozenset() | dict():
                self._inside(value, self._add_items)
            case _:
                self._inside(value, self._add_object)

    def _once(self, value: Any, add: Any) -> None:
        known = self.seen.get(id(value))
        if known is not None:
            self.tag("again", known)
            return
        self.seen[id(value)] = len(self.seen)
        self.kept.append(value)
        add(value)

    def _inside(self, value: Any, add: Any) -> None:
        for depth, other in enumerate(reversed(self.around)):
            if other is value:
                self.tag("around", depth)
                return
        self.around.append(value)
        try:
            add(value)
        except RecursionError as error:
            raise self._refusal(value) from error
        self.around.pop()

    def _add_items(self, value: Any) -> None:
        self.tag(type(value).__name__, len(value))
        if isinstance(value, Mapping):
            self._unordered(value.items())
        elif isinstance(value, Set):
            self._unordered(value)
        else:
            for item in value:
                self.add(item)

    def _unordered(self, values: Iterable[object]) -> None:
        for text in sorted(self._apart(value) for value in values):
            self.tag(text)

    def _apart(self, value: object) -> str:
        part = _Content(self.what)
        part.seen, part.kept, part.around = dict(self.seen), self.kept, self.around
        part.add(value)
        return part.hexdigest()

    def _add_object(self, value: Any) -> None:
        """Anything else, by what its pickle would hold: its class, and its state."""
        if isinstance(value, (staticmethod, classmethod, property, cached_property)):
            names = ("__func__", "func", "fget", "fset", "fdel")  # there is no pickle of these
            self.add([type(value).__name__, *(getattr(value, name, None) for name in names)])
            return
        if isinstance(value, BuiltinFunctionType) and isinstance(value.__self__, ModuleType | None):
            self.tag("built in", value.__module__, value.__qualname__)
            return
        try:
            made = value.__reduce_ex__(4)
        except Exception as error:  # objects raise what they like
            raise self._refusal(value) from error
        if isinstance(made, str):  # an object that its module has by this name
            self.tag("global", getattr(value, "__module__", ""), made)
            return
        made = [list(part) if k in (3, 4) and part else part for k, part in enumerate(made)]
        if len(made) > 2 and isinstance(made[2], dict):  # its state, not what was computed of it
            given = {k: getattr(type(value), k, None) for k in made[2]}
            made[2] = {
                k: x for k, x in made[2].items() if not isinstance(given[k], cached_property)
            }
        self.tag(type(value).__qualname__, len(made))
        for part in made:
            self.add(part)

    def _add_function(self, value: FunctionType) -> None:
        self.tag("function")
        module = sys.modules.get(value.__module__ or "")
        if module is not None and _is_installed(module):
            self.tag(value.__module__, value.__qualname__, _version_of(module))
            if value.__closure__ is None:
                return
        self._add_code(value.__code__)
        self.add([value.__defaults__, value.__kwdefaults__])
        for cell in value.__closure__ or ():
            try:
                inside = cell.cell_contents
            except ValueError:  # nothing was put into it yet
                inside = None
            self.add(inside)
        for name in sorted(_globals_of(value.__code__)):
            if name in value.__globals__:
                self.tag(name)
                self.add(value.__globals__[name])

    def _add_code(self, code: CodeType) -> None:
        """Instructions and constants, not the place in a file."""
        counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
        self.tag("code", code.co_code, counts, code.co_names, code.co_varnames, code.co_freevars)
        self.add(list(code.co_consts))

    def _add_class(self, value: type) -> None:
        module = sys.modules.get(value.__module__)
        self.tag("class", value.__module__ if module is None else "", value.__qualname__)
        if module is not None and _is_installed(module):
            self.tag(value.__module__, _version_of(module))
            return
        self.add(list(value.__bases__))
        own = {name: x for name, x in vars(value).items() if name not in _ROUTINE}
        for name in sorted(own):
            self.tag(name)
            self.add(own[name])

    def _add_module(self, value: ModuleType) -> None:
        self.tag("module", value.__name__)
        if _is_installed(value):
            self.tag(_version_of(value))
            return
        file = getattr(value, "__file__", None)
        if file is not None:
            self.tag(hashlib.blake2b(Path(file).read_bytes()).hexdigest())
        for name, other in sorted(vars(value).items()):
            home = sys.modules.get(getattr(other, "__module__", None) or "")
            for used in (other, home):
                if isinstance(used, ModuleType) and used is not value:
                    self.tag(name)
                    self.add(used)

    def _refusal(self, value: object) -> ModelError:
        kind = type(value)
        where = "" if kind.__module__ == "builtins" else f"{kind.__module__}."
        return ModelError(
            f"{self.what} cannot be stored: it rests on a {where}{kind.__qualname__}, and nothing "
            "tells whether the next one is the same; make it of numbers, texts, functions and "
            "records of these, or run without a path"
        )


def _globals_of(code: CodeType) -> set[str]:
    found = {i.argval for i in dis.get_instructions(code) if i.opname in _LOOKUPS}
    inner = (const for const in code.co_consts if isinstance(const, CodeType))
    return found.union(*map(_globals_of, inner))


_LOOKUPS = {"LOAD_GLOBAL", "LOAD_NAME"}


def _is_installed(module: ModuleType) -> bool:
    """True for libraries, which their versions tell apart; False for what users write."""
    if module.__name__ == "__main__":
        return False
    file = getattr(module, "__file__", None)
    if file is None:
        return module.__name__.split(".")[0] in sys.builtin_module_names or hasattr(
            module, "__path__"
        )
    path = Path(file)
    if {"site-packages", "dist-packages"} & {*path.parts}:
        return True
    libraries = {Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")}
    return bool({*libraries, Path(__file__).parents[2]} & {*path.parents})


def _version_of(module: ModuleType) -> str:
    top = sys.modules.get(module.__name__.split(".")[0])
    return str(getattr(top, "__version__", ""))

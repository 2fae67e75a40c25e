"""The form of a file, said once: how each entry is read, checked, written and described.

A :class:`Form` is of one value, a :func:`record` of a dataclass with a :class:`Key` for each field;
a :class:`Document` is a record with a header, in a file of its own: it reads and writes that file,
whole or not at all, and says in refusals which one it is. What equals its default is left out in
writing.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import MISSING, dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar, get_args, get_type_hints

import numpy as np

from cvxlimit.base.checks import meant, of_type
from cvxlimit.base.files import write_file
from cvxlimit.errors import InputError
from cvxlimit.io.fields import (
    ANY_FINITE,
    LARGEST_NUMBER,
    FilePath,
    JsonObject,
    check_header,
    encoded,
    fields,
    file_prefix,
    items,
    mapping,
    number,
    numbers,
    read_document,
    refusals,
    shown,
    text,
    whole,
)

T = TypeVar("T")
Step = Callable[[Any, str, str], Any]


@dataclass(frozen=True)
class Form:
    """How a value stands in a JSON document, whose JSON Schema is ``schema``.

    ``read`` and ``write`` are given the value, where it stands ("start of entry 0 of ties") and in
    what ("entry 0 of ties"), for refusals.
    """

    read: Step
    write: Step
    schema: JsonObject


def plain(
    read: Callable[[Any, str], Any],
    schema: JsonObject,
    write: Callable[[Any, str], Any] | None = None,
) -> Form:
    """The form of a value that is checked by itself; it is written by the same check if None."""
    back = write or read
    return Form(lambda x, where, _: read(x, where), lambda x, where, _: back(x, where), schema)


TEXT = plain(text, {"type": "string"})
NUMBER = plain(number, {"type": "number"})
FINITE = plain(lambda value, where: number(value, where, ANY_FINITE), {"type": "number"})
WHOLE = plain(whole, {"type": "integer", "minimum": 0}, lambda value, _: int(value))


def row(
    names: Collection[str], largest: float = LARGEST_NUMBER, made: Callable[[Any], Any] = tuple
) -> Form:
    """As many numbers as there are names, of at most ``largest`` in magnitude."""
    size = {"minItems": len(names), "maxItems": len(names)}
    return plain(
        lambda value, where: made(numbers(value, names, where, largest)),
        {"type": "array", "items": {"type": "number"}, **size, "description": ", ".join(names)},
        lambda value, where: list(numbers(np.asarray(value).tolist(), names, where, largest)),
    )


def choice(words: Iterable[str]) -> Form:
    """One of some words, also of an enumeration of texts; what is read is a plain text."""
    kind = {str(word): word for word in words}

    def read(value: object, where: str) -> str:
        if text(value, where) not in kind:
            known = ", ".join(map(repr, kind))
            raise InputError(
                f"{where} must be one of {known}, got {shown(value)}"
                + meant(value, kind, before="; ")
            )
        return kind[str(value)]

    return plain(read, {"enum": [*kind]}, lambda value, _: str(value))


def _truth(value: Any, where: str) -> bool:
    """True for "yes", False for "no"."""
    return choice(("yes", "no")).read(value, where, "") == "yes"


FLAG = plain(_truth, {"enum": ["yes", "no"]}, lambda value, _: "yes" if value else "no")


def nullable(form: Form, none: float | None = None) -> Form:
    """``null`` stands for ``none``."""

    def write(value: Any, *place: str) -> Any:
        is_none = isinstance(value, type(none)) and value == none
        return None if is_none else form.write(value, *place)

    return Form(
        lambda value, *place: none if value is None else form.read(value, *place),
        write,
        {"anyOf": [form.schema, {"type": "null"}]},
    )


def listed(
    item: Form,
    name: str = "entry {i} of {where}",
    made: Callable[[list[Any]], Any] = tuple,
    prefix: str = "",
) -> Form:
    """A list of equal items; ``made`` makes of it what Python is given.

    Refusals call an item ``name``, with i, where and owner put in; ``prefix`` leads what ``made``
    says.
    """

    def each(step: Step, value: Iterable[Any], where: str, owner: str) -> list[Any]:
        return [
            step(x, name.format(i=i, where=where, owner=owner), where) for i, x in enumerate(value)
        ]

    def read(value: object, where: str, owner: str) -> Any:
        entries = items(value, where)
        with refusals(prefix.format(owner=owner)):
            return made(each(item.read, entries, where, owner))

    schema: JsonObject = {"type": "array", "items": item.schema}
    return Form(read, lambda value, *place: each(item.write, value, *place), schema)


def keyed(item: Form, name: str) -> Form:
    """An object of equal items by keys that the user chose, as of blocks by their ids."""

    def each(step: Step, value: object, where: str, owner: str) -> JsonObject:
        return {
            key: step(x, name.format(key=shown(key), owner=owner), where)
            for key, x in mapping(value, where).items()
        }

    return Form(
        lambda value, *place: each(item.read, value, *place),
        lambda value, *place: each(item.write, dict(value), *place),
        {"type": "object", "additionalProperties": item.schema},
    )


@dataclass(frozen=True)
class Key:
    """An entry of a record; refusals call it ``where``, with the key and the record put in, or as
    the record's entries are called unless given.

    What is not needed may be left out, is then the field's default or None, and is not written
    where it equals that, unless ``is_written``; None asks the field whether it has a default. An
    entry that ``is_several`` fields is read as a dict of them, written from the whole record, left
    out where that gives None, and not needed unless it is said to be. ``field`` names the field
    where it is not called as its key.
    """

    form: Form
    where: str = ""
    is_needed: bool | None = None
    is_written: bool = False
    is_several: bool = False
    field: str = ""


def record(
    kind: type,
    keys: Mapping[str, Key | Form],
    made: Callable[..., Any] | None = None,
    prefix: str = "",
    where: str = "{key} of {owner}",
) -> Form:
    """The fields of a dataclass as an object; ``made`` makes one of them, in place of ``kind``.

    ``prefix`` leads what ``made`` says, ``where`` is what refusals call an entry.
    """
    defaults = _defaults(kind)
    entries = {key: _completed(given, key, where, defaults) for key, given in keys.items()}
    needed = [key for key, each in entries.items() if each.is_needed]
    optional = [key for key in entries if key not in needed]

    def read(value: object, where: str, _: str) -> Any:
        entry, given = fields(value, where, needed, optional), dict[str, Any]()
        for key, each in entries.items():
            if key in entry:
                found = each.form.read(entry[key], each.where.format(key=key, owner=where), where)
                given |= found if each.is_several else {each.field: found}
            elif key not in defaults and not each.is_several:
                given[key] = None
        with refusals(prefix.format(where=where)):
            return (made or kind)(**given)

    def write(value: Any, where: str, _: str) -> JsonObject:
        result: JsonObject = {}
        for key, each in entries.items():
            found = value if each.is_several else getattr(value, each.field)
            usual = defaults.get(key)
            is_usual = found is usual or (not isinstance(found, np.ndarray) and found == usual)
            if each.is_needed or each.is_written or not is_usual:
                entry = each.form.write(found, each.where.format(key=key, owner=where), where)
                if entry is not None or not each.is_several:
                    result[key] = entry
        return result

    schema = {
        "type": "object",
        "properties": {key: each.form.schema for key, each in entries.items()},
        "required": needed,
        "additionalProperties": False,
    }
    return Form(read, write, schema)


def _completed(given: Key | Form, key: str, where: str, defaults: Collection[str]) -> Key:
    """The entry with what it leaves to its record."""
    each = given if isinstance(given, Key) else Key(given)
    has_default = key in defaults or each.is_several
    return dataclasses.replace(
        each,
        where=each.where or where,
        field=each.field or key,
        is_needed=not has_default if each.is_needed is None else each.is_needed,
    )


def _defaults(kind: type) -> dict[str, Any]:
    """Default of each field of a dataclass that has one."""
    made = {
        each.name: each.default if each.default_factory is MISSING else each.default_factory()
        for each in dataclasses.fields(kind)
    }
    return {name: value for name, value in made.items() if value is not MISSING}


def by_type(kind: type, figure: Form, *names: str) -> dict[str, Form]:
    """Forms of the fields of a dataclass, or of some, that follow from their types; ``figure`` is
    that of a number.

    >>> from cvxlimit.scene import Units
    >>> by_type(Units, NUMBER)["length"] is TEXT
    True
    """
    plain = {str: TEXT, int: WHOLE, bool: FLAG, float: figure}

    def form(hint: Any) -> Form:
        if hint in plain:
            return plain[hint]
        first, *others = get_args(hint)  # of X | None, or of tuple[X, ...]
        return listed(form(first)) if others == [...] else nullable(form(first))

    hints = get_type_hints(kind)
    return {name: form(hints[name]) for name in names or hints}


def together(forms: Mapping[str, Form]) -> Form:
    """An object with an entry for each form, which is a tuple in Python."""
    kind = dataclasses.make_dataclass("Together", forms)
    inner = record(kind, forms, lambda **given: tuple(given.values()))
    return Form(inner.read, lambda value, *place: inner.write(kind(*value), *place), inner.schema)


@dataclass(frozen=True)
class Document(Generic[T]):
    """A record in a file of its own, with a header that says what it is: scene or result.

    ``of``, ``keys``, ``made`` and ``where`` are as for :func:`record`. What is no such thing is not
    written, but refused under the name ``called``, with the ``cure``.
    """

    kind: str
    of: type[T]
    called: str
    cure: str
    keys: Mapping[str, Key | Form]
    made: Callable[..., T]
    where: str = "{key}"

    @cached_property
    def form(self) -> Form:
        return record(self.of, self.keys, self.made, where=self.where)

    def check(self, value: object) -> None:
        of_type(value, self.of, f"{self.called} must be a {self.of.__name__}", self.cure)

    def from_dict(self, document: Any) -> T:
        with refusals():
            check_header(document, self.kind)
            header = "$schema", "format", "version"
            entries = {key: x for key, x in document.items() if key not in header}
            return self.form.read(entries, f"the {self.kind}", "")

    def to_dict(self, value: T) -> JsonObject:
        self.check(value)
        with refusals():
            header = {"format": f"cvxlimit-{self.kind}", "version": 1}
            return header | self.form.write(value, f"the {self.kind}", "")

    def read(self, path: FilePath) -> T:
        with refusals(file_prefix(path)):
            return self.from_dict(read_document(path))

    def write(self, value: T, path: FilePath) -> None:
        self.check(value)
        with refusals(file_prefix(path)):
            data = encoded(self.to_dict(value))
        write_file(path, data)

    @property
    def inside(self) -> Form:
        """Inside another document, with its own header."""
        return Form(lambda x, *_: self.from_dict(x), lambda x, *_: self.to_dict(x), self.schema)

    @property
    def schema(self) -> JsonObject:
        header = {
            "$schema": {"type": "string"},
            "format": {"const": f"cvxlimit-{self.kind}"},
            "version": {"const": 1},
        }
        body = self.form.schema
        return {
            "$schema": "https://json-schema.org/draft/2020-12/schema",
            "title": f"cvxlimit {self.kind}, version 1",
            **body,
            "properties": header | body["properties"],  # type: ignore[operator]
            "required": ["format", "version", *body["required"]],  # type: ignore[misc]
        }

"""Commands as records: the fields of a dataclass are what a command takes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, field, fields
from functools import partial
from inspect import Parameter, Signature
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

from cvxlimit.errors import InputError

R = TypeVar("R")
Job = Callable[[], int]

SCENE = "Scene file, or name of a built-in scene."


def argument(help: str = SCENE, metavar: str = "SCENE") -> Any:
    return field(metadata={"typer": typer.Argument(metavar=metavar, help=help, show_default=False)})


def option(metavar: str, help: str, default: Any = None, *names: str, **more: Any) -> Any:
    shown = isinstance(default, (str, int))
    made = typer.Option(*names, metavar=metavar, help=help, show_default=shown, **more)
    return field(default=MISSING if default is ... else default, metadata={"typer": made})


def taking(record: type[R]) -> Callable[[Callable[[R], int]], Callable[..., Job]]:
    hints = get_type_hints(record)
    parameters = [
        Parameter(
            each.name,
            Parameter.KEYWORD_ONLY,
            default=Parameter.empty if each.default is MISSING else each.default,
            annotation=Annotated[hints[each.name], each.metadata["typer"]],
        )
        for each in fields(record)  # type: ignore[arg-type]
    ]

    def made(work: Callable[[R], int]) -> Callable[..., Job]:
        def command(**given: Any) -> Job:
            return partial(work, record(**given))

        command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        command.__doc__ = work.__doc__
        return command

    return made


def surface_option() -> Any:
    return option("conic|octagon|K-gon", "Yield surface, as for solve.", "conic")


def result_option() -> Any:
    return option("OUT", "Write the result to this JSON file; - is stdout.")


def named_values(option: str, given: Sequence[str], form: str) -> Iterator[tuple[str, str, str]]:
    """Each NAME=VALUE whole, its name, and its value; ``form`` is told where one is not so."""
    known = set[str]()
    for text in given:
        name, sign, value = text.partition("=")
        if not (name and sign and value):
            raise InputError(f"{option} {text}: {form}")
        if name in known:
            raise InputError(f"{option} {text}: {name!r} is given already: give it once; {form}")
        known.add(name)
        yield text, name, value


def vector(name: str, text: str, example: str) -> tuple[float, ...]:
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            f"{name} must be three numbers X,Y,Z, as in {example}, got {text!r}"
        ) from error
    return x, y, z

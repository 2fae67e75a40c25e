"""Commands as records: the fields of a dataclass are what a command takes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import MISSING, field, fields
from functools import partial
from inspect import Parameter, Signature
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

from cvxlimit.base.progressbar import LOG
from cvxlimit.cli.report import VOICE
from cvxlimit.errors import InputError

R = TypeVar("R")
Job = Callable[[], int]

SCENE = "Scene file, or name of a built-in scene."


def argument(help: str = SCENE, metavar: str = "SCENE") -> Any:
    return field(metadata={"typer": typer.Argument(metavar=metavar, help=help, show_default=False)})


MODEL, OUTPUT, EFFORT = "Model", "Output", "Effort"
"""Groups of options in the help."""


def option(
    metavar: str, help: str, default: Any = None, *names: str, group: str = MODEL, **more: Any
) -> Any:
    made = typer.Option(
        *names, metavar=metavar, help=help, show_default=False, rich_help_panel=group, **more
    )
    return field(default=MISSING if default is ... else default, metadata={"typer": made})


_VOICE = [
    Parameter(
        name,
        Parameter.KEYWORD_ONLY,
        default=False,
        annotation=Annotated[
            bool, typer.Option(f"--{name}", f"-{name[0]}", help=said, rich_help_panel=OUTPUT)
        ],
    )
    for name, said in (
        ("verbose", "Report every step on stderr."),
        ("quiet", "Print nothing but errors."),
    )
]
"""Options of every command that works on a scene."""


def speaking(work: Job, verbose: bool, quiet: bool) -> Job:
    """The work with the log on stderr, or without anything shown."""
    if verbose and quiet:
        raise InputError("--verbose and --quiet exclude each other: leave one out")

    def job() -> int:
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
        level = LOG.level
        token = VOICE.set(-1 if quiet else int(verbose))
        try:
            if verbose:
                LOG.addHandler(handler)
                LOG.setLevel(logging.INFO)
            return work()
        finally:
            VOICE.reset(token)
            LOG.removeHandler(handler)
            LOG.setLevel(level)

    return job


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
        def command(*, verbose: bool, quiet: bool, **given: Any) -> Job:
            return speaking(partial(work, record(**given)), verbose, quiet)

        command.__signature__ = Signature([*parameters, *_VOICE])  # type: ignore[attr-defined]
        command.__doc__ = work.__doc__
        return command

    return made


def surface_option(default: str | None = "conic") -> Any:
    return option("NAME", "Yield surface, as for solve: conic (default), octagon ...", default)


def model_option() -> Any:
    return option("NAME", "Size of the model, as for solve: auto (default), full or least.", "auto")


def output_option(metavar: str, help: str) -> Any:
    return option(metavar, help, None, "--output", "-o", group=OUTPUT)


def result_option() -> Any:
    return option("FILE", "JSON file of the result; - is stdout.", group=OUTPUT)


def either(names: Iterable[str]) -> str:
    """What may be chosen, as running text, which is not broken within names.

    >>> either(["auto", "full", "least"])
    'auto, full or least'
    """
    *others, last = names
    return f"{', '.join(others)} or {last}"


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

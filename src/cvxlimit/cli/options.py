"""Commands as records: the fields of a dataclass are what a command takes.

Each field is made with :func:`argument` or :func:`option`, which keep what Typer needs to know in
the field's metadata; :func:`command_of` makes the command from the record.
"""

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
"""Work still to be done; returns the exit code."""

SCENE = "Scene file, or name of a built-in scene."


def argument(help: str = SCENE, metavar: str = "SCENE") -> Any:
    """A field that is given by its place on the command line, and must be given."""
    return field(metadata={"typer": typer.Argument(metavar=metavar, help=help, show_default=False)})


MODEL, OUTPUT, EFFORT = "Model", "Output", "Effort"
"""Groups of options in the help."""


def option(
    metavar: str, help: str, default: Any = None, *names: str, group: str = MODEL, **more: Any
) -> Any:
    """A field that is given by a flag: those in ``names``, or the field's name with dashes.

    ``default`` is ``...`` for an option that must be given; no list or other value that can change,
    which all calls would share. ``more`` is for :func:`typer.Option`.
    """
    flag = typer.Option(
        *names, metavar=metavar, help=help, show_default=False, rich_help_panel=group, **more
    )
    return field(default=MISSING if default is ... else default, metadata={"typer": flag})


_VERBOSITY = [
    Parameter(
        name,
        Parameter.KEYWORD_ONLY,
        default=False,
        annotation=Annotated[
            bool, typer.Option(f"--{name}", f"-{name[0]}", help=said, rich_help_panel=OUTPUT)
        ],
    )
    for name, said in (
        ("verbose", "Say more; report every step on stderr."),
        ("quiet", "Print nothing but errors."),
    )
]
"""Parameters that every command has beside those of its record."""


def _with_voice(work: Job, verbose: bool, quiet: bool) -> Job:
    """The work with the log on stderr, or without anything shown; afterwards all is as before."""
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


def command_of(
    record: type[R], epilog: str | None = None
) -> Callable[[Callable[[R], int]], Callable[..., Job]]:
    """Decorator: a function of one such record becomes a Typer command with an option or argument
    for each of its fields; ``epilog`` ends its help.

    Typer takes parameters from the signature and the help from the docstring, which are therefore
    put together here. The command does not do the work but returns it as a job, which ``main`` runs
    outside Typer for its exit code: no error in the work is taken for a mistake in the options.
    """
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

    def decorate(work: Callable[[R], int]) -> Callable[..., Job]:
        def command(*, verbose: bool, quiet: bool, **given: Any) -> Job:
            return _with_voice(partial(work, record(**given)), verbose, quiet)

        command.__signature__ = Signature([*parameters, *_VERBOSITY])  # type: ignore[attr-defined]
        command.__doc__ = work.__doc__
        command.epilog = epilog  # type: ignore[attr-defined]
        return command

    return decorate


def surface_option(default: str | None = "conic") -> Any:
    """Of commands that solve; None is for one that must know whether it was given."""
    return option("NAME", "Yield surface, as for solve: conic (default), octagon ...", default)


def model_option() -> Any:
    """Of commands that solve."""
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
    """Of each NAME=VALUE given with ``option``: the whole, the name and the value.

    A refusal says ``form``, how it should be written.

    >>> [*named_values("--friction", ["b=0.5"], "write NAME=VALUE")]
    [('b=0.5', 'b', '0.5')]
    """
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
    """The three numbers of X,Y,Z; a refusal names what they are of and gives the example.

    >>> vector("--live", "1,0,-0.5", "1,0,0")
    (1.0, 0.0, -0.5)
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            f"{name} must be three numbers X,Y,Z, as in {example}, got {text!r}"
        ) from error
    return x, y, z


def numbers(option: str, text: str, example: str) -> Sequence[float]:
    """As many numbers as the example has."""
    wanted = example.split(", or")[0].count(",") + 1
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != wanted:
        raise InputError(f"{option} {text}: {wanted} numbers are meant, as in {example}")
    return found


def named_block(text: str | None) -> tuple[str, tuple[float, ...]] | None:
    """Block and direction of ``--control``."""
    if text is None:
        return None
    block, colon, direction = text.rpartition(":")
    if not (block and colon):
        raise InputError(f"--control {text}: BLOCK:X,Y,Z is meant, as in b17:0,1,0")
    return block, vector(f"--control {block}", direction, "b17:0,1,0")

"""Commands as records: the fields of a dataclass are what a command takes, its docstring says it.

Name, type and default of an option are those of the field. What stands for its value, and its help,
are read from the docstring, in sections named for the groups of the help, as numpydoc has them::

    Output
    ------
    csv, -c : FILE
        Write a row for each step.

What is given by its place stands under ``Arguments``, what ends the help under ``Exit code``. An
option that the command does not describe is described by :class:`Command`.
"""

from __future__ import annotations

import logging
import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from inspect import Parameter, Signature, cleandoc
from typing import Annotated, Any, ClassVar, get_type_hints

import typer

from cvxlimit.base.progressbar import LOG
from cvxlimit.cli.shell import VOICE
from cvxlimit.errors import InputError, ModelError

Job = Callable[[], int]
"""Work still to be done; returns the exit code."""


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """What is given to a command, and :meth:`run`, which does it.

    Arguments
    ---------
    scene : SCENE
        Scene file, or name of a built-in scene.

    Model
    -----
    surface : NAME
        Yield surface, as for solve: conic (default), octagon ...
    model : NAME
        Size of the model, as for solve: auto (default), full or least.

    Output
    ------
    json : FILE
        JSON file of the result; - is stdout.
    plot : [KIND:]FILE
        Draw the mechanism, or what KIND says: {pictures}. Repeatable.
    report : FILE.html
        Page to print and to sign.
    verbose, -v
        Say more; report every step on stderr.
    quiet, -q
        Print nothing but errors.
    """

    names: ClassVar[Mapping[str, object]] = {}
    """What stands in the help for words in braces, as {pictures}."""

    verbose: bool = False
    quiet: bool = False

    @abstractmethod
    def run(self) -> int:
        """Do the work and return the exit code."""

    def __call__(self) -> int:
        """Run with the log on stderr, or with nothing shown; afterwards all is as before."""
        if self.verbose and self.quiet:
            raise InputError("--verbose and --quiet exclude each other: leave one out")
        handler = logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
        level = LOG.level
        voice = VOICE.set(int(self.verbose) - int(self.quiet))
        try:
            if self.verbose:
                LOG.addHandler(handler)
                LOG.setLevel(logging.INFO)
            return self.run()
        finally:
            VOICE.reset(voice)
            LOG.removeHandler(handler)
            LOG.setLevel(level)


_SECTION = re.compile(r"\n*^(\w[\w ]*)\n-+\n", re.MULTILINE)
"""A section's name, underlined."""

_ENTRY = re.compile(r"^(\w+)(?:, (-\w))?(?: : (.+))?\n((?:    .+\n?)+)", re.MULTILINE)
"""An entry ``name, -n : METAVAR`` with its indented help: name, short form, metavar and help."""


def typer_command(kind: type[Command]) -> Callable[..., Job]:
    """The function that Typer makes a command of, and its ``epilog``.

    It does not do the work but returns it as a job, which ``main`` runs outside Typer for its exit
    code: no error in the work is taken for a mistake in the options.

    Raises
    ------
    ModelError
        For a field that no docstring describes.
    """
    # What docstrings say: group, short form, metavar and help of each option. What the command says
    # itself counts more than what all commands share.
    said = dict[str, tuple[str, ...]]()
    _, *shared = _SECTION.split(cleandoc(Command.__doc__ or ""))
    summary, *own = _SECTION.split(cleandoc(kind.__doc__ or ""))
    for sections in (shared, own):
        for group, text in zip(sections[::2], sections[1::2], strict=True):
            said |= {name: (group, *more) for name, *more in _ENTRY.findall(text)}

    # A parameter for each field, with those that all commands have at the end.
    hints, parameters = get_type_hints(kind), []
    for field in sorted(fields(kind), key=lambda field: field.name in ("verbose", "quiet")):
        if field.name not in said:
            raise ModelError(
                f"command {kind.__name__}: its docstring does not describe {field.name!r}: add "
                f"'{field.name} : VALUE' and a line of help below it, in a section like Model"
            )
        group, short, metavar, text = said[field.name]
        words = " ".join(text.split()).format_map(kind.names)
        shown: dict[str, Any] = {"metavar": metavar, "help": words, "show_default": False}
        flags = [f"--{field.name.replace('_', '-')}", *filter(None, [short])]
        if group == "Arguments":
            made = typer.Argument(**shown)
        else:
            made = typer.Option(*flags, rich_help_panel=group, **shown)
        parameters.append(
            Parameter(
                field.name,
                Parameter.KEYWORD_ONLY,
                default=Parameter.empty if field.default is MISSING else field.default,
                annotation=Annotated[hints[field.name], made],
            )
        )

    # Typer reads the signature, the docstring as help, and what ends the help.
    def command(**given: Any) -> Job:
        return kind(**given)

    command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    command.__doc__ = summary
    ends = " ".join(dict(zip(own[::2], own[1::2], strict=True)).get("Exit code", "").split())
    command.epilog = f"Exit code: {ends}" if ends else None  # type: ignore[attr-defined]
    return command


def either(names: Iterable[str]) -> str:
    """What may be chosen, as running text, which is not broken within names.

    >>> either(["auto", "full", "least"])
    'auto, full or least'
    """
    *others, last = names
    return f"{', '.join(others)} or {last}"


def named_values(option: str, given: Sequence[str], form: str) -> Iterator[tuple[str, str, str]]:
    """Returns of each NAME=VALUE given with ``option`` the whole, the name and the value.

    The refusal of any other text, or of a name that was given before, ends with ``form``, which
    says how to write it.

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
    """Returns the three numbers of X,Y,Z. The refusal of any other text names the option, ``name``,
    and gives the ``example``.

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


def numbers(option: str, text: str, count: int, example: str) -> Sequence[float]:
    """Returns the ``count`` numbers of a text with commas between them. The refusal of any other
    text names the ``option`` and gives the ``example``."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count:
        raise InputError(f"{option} {text}: {count} numbers are meant, as in {example}")
    return found


def control_of(text: str | None) -> tuple[str, tuple[float, ...]] | None:
    """Returns block and direction of ``--control BLOCK:X,Y,Z``; None if it is not given."""
    if text is None:
        return None
    block, colon, direction = text.rpartition(":")
    if not (block and colon):
        raise InputError(f"--control {text}: BLOCK:X,Y,Z is meant, as in b17:0,1,0")
    return block, vector(f"--control {block}", direction, "b17:0,1,0")

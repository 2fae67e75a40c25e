"""An experiment: a generator of tables, the options that its arguments are, the records it leaves.

::

    @experiment(Part(1))
    def small(scenes: Sequence[str] = SCENES, repeat: int = 5) -> Lines:
        yield Head("scene", "seconds")
        for name in scenes:
            yield name, seconds_of(name, repeat)

is ``python -m benchmarks run small --scenes arch --repeat 3``, and ``python -m benchmarks all``
keeps what it prints as the record ``small``. A tuple is a row of the table that the last
:class:`Head` began; a text is a line; :class:`Title` is a heading that pages name.
"""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import UnionType
from typing import Any, TypeAlias, get_args, get_origin, get_type_hints


class Head(tuple[str, ...]):
    """The head of a table."""

    def __new__(cls, *cells: str) -> Head:
        return super().__new__(cls, cells)


class Title(str):
    """A heading: what stands below it is shown by ``<!-- record NAME: TITLE -->`` on a page."""


Lines: TypeAlias = Iterator[Head | Title | str | tuple[object, ...]]


@dataclass(frozen=True)
class Part:
    """A record that an experiment leaves.

    Attributes
    ----------
    minutes : float
        About how long it takes on one core, for whom waits.
    arguments : str
        What follows the experiment's name at the command line.
    name : str
        Of the record; that of the experiment unless given.
    """

    minutes: float
    arguments: str = ""
    name: str = ""
    experiment: str = ""

    @property
    def command(self) -> str:
        """What follows ``python -m``."""
        return f"benchmarks run {self.experiment} {self.arguments}".strip()


@dataclass(frozen=True)
class Experiment:
    """What :func:`experiment` registers."""

    name: str
    run: Callable[..., Lines]
    parts: tuple[Part, ...] = ()
    group: str = "run"

    @property
    def what(self) -> str:
        """Its first sentence."""
        return " ".join((self.run.__doc__ or "").split("\n\n")[0].split())

    def parser(self) -> argparse.ArgumentParser:
        """An option for every argument: several values for a sequence, a switch for a bool."""
        about = f"{self.run.__doc__ or ''}\n\n{inspect.getmodule(self.run).__doc__ or ''}"  # type: ignore[union-attr]
        parser = argparse.ArgumentParser(
            prog=f"python -m benchmarks {self.group} {self.name}", description=about,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        hints = get_type_hints(self.run)
        for name, argument in inspect.signature(self.run).parameters.items():
            kind, default = hints[name], argument.default
            option: dict[str, Any] = {"default": default, "help": f"unless given: {_said(default)}"}
            if default is inspect.Parameter.empty:
                option = {"required": True}
            if kind is bool:
                option["action"] = "store_true"
            elif get_origin(kind) is not None and get_origin(kind) is not UnionType:
                option |= {"nargs": "*", "type": _typed(get_args(kind)[0])}
            else:
                option["type"] = _typed(
                    next((k for k in get_args(kind) if k is not type(None)), kind)
                )
            parser.add_argument(f"--{name.replace('_', '-')}", **option)
        return parser

    def __call__(self, arguments: Sequence[str] = ()) -> None:
        """Parse the options, and print what comes as soon as it comes."""
        for line in marked(self.run(**vars(self.parser().parse_args(arguments)))):
            sys.stdout.write(f"{line}\n")
            sys.stdout.flush()


def marked(lines: Lines) -> Iterator[str]:
    """Markdown, line by line.

    >>> list(marked(iter([Title("walls"), Head("wall", "s"), (1, 0.5)])))
    ['### walls', '| wall | s |', '|---|---|', '| 1 | 0.5 |']
    """
    for line in lines:
        if isinstance(line, Title):
            yield f"### {line}"
        elif isinstance(line, str):
            yield line
        else:
            yield f"| {' | '.join(map(str, line))} |"
            if isinstance(line, Head):
                yield f"|{'---|' * len(line)}"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A whole table."""
    return "\n".join(marked(iter([Head(*head), *map(tuple, rows)])))


def _said(default: object) -> str:
    if isinstance(default, (tuple, list)):
        return " ".join(map(str, default)) or "none"
    return "none" if default is None else str(default)


def place(text: str) -> Path:
    """A folder that is there, or a file in one: nothing is measured that could not be written.

    >>> place("no-such-folder/picture.png")
    Traceback (most recent call last):
    argparse.ArgumentTypeError: there is no folder 'no-such-folder'; create it first
    """
    path = Path(text)
    folder = path.parent if path.suffix else path
    if not folder.is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder '{folder}'; create it first")
    return path


def _typed(kind: Any) -> Callable[[str], Any]:
    """Numbers are above zero, or zero where nothing is a choice: none of them is a direction."""
    if kind is Path:
        return place

    def parse(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = -1
        if not 0 <= value < float("inf"):
            what = "a whole number" if kind is int else "a number"
            raise argparse.ArgumentTypeError(f"must be {what}, 0 or above, got {text}")
        return value

    return parse if kind in (int, float) else kind


EXPERIMENTS: dict[str, Experiment] = {}


def experiment(
    *parts: Part, name: str = ""
) -> Callable[[Callable[..., Lines]], Callable[..., Lines]]:
    """Registers the generator below it under its own name, with the records that it leaves."""

    def register(run: Callable[..., Lines]) -> Callable[..., Lines]:
        own = name or run.__name__
        made = tuple(replace(part, name=part.name or own, experiment=own) for part in parts)
        EXPERIMENTS[own] = Experiment(own, run, made)
        return run

    return register


def experiments() -> dict[str, Experiment]:
    """All of them by name: every module of the folder is asked."""
    folder = Path(__file__).with_name("experiments")
    for module in sorted(found.name for found in iter_modules([str(folder)])):
        import_module(f"benchmarks.experiments.{module}")
    return EXPERIMENTS

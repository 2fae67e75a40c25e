"""``cvxlimit explain``: how much model a scene gets, which solver, how long it will take."""

# options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass

from rich.text import Text

from cvxlimit.cli.interrupting import interruptible
from cvxlimit.cli.naming import scene_named
from cvxlimit.cli.options import argument, option, surface_option, taking
from cvxlimit.cli.outputs import ExitCode
from cvxlimit.cli.report import show
from cvxlimit.io.fields import one_line
from cvxlimit.reductions.choice import MODELS
from cvxlimit.reductions.explaining import explain


@dataclass(frozen=True, kw_only=True)
class Question:
    """What ``cvxlimit explain`` is asked."""

    scene: str = argument()
    surface: str = surface_option()
    model: str = option("|".join(MODELS), "How much model, as for solve.", "auto")


@taking(Question)
def explain_command(asked: Question) -> ExitCode:
    """Say how much model a scene gets, which solver, and how long it will take; solve nothing."""
    found = interruptible(
        lambda tell: explain(scene_named(asked.scene), asked.surface, model=asked.model)
    )
    title, *lines = str(found).splitlines()
    show(Text("\n".join([one_line(title), *lines])))
    return ExitCode.SOLVED

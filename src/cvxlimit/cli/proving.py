"""``cvxlimit prove``: what a file or a folder says, proved again from what it holds."""

# options are field() of dataclasses

from __future__ import annotations

from dataclasses import dataclass

from rich.text import Text

from cvxlimit.cli.options import argument, command_of, option
from cvxlimit.cli.report import ExitCode, counted, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.io.fields import one_line
from cvxlimit.proving.prove import prove


@dataclass(frozen=True, kw_only=True)
class Claimed:
    """What ``cvxlimit prove`` is asked."""

    file: str = argument(
        "Result file (solve --json), load domain (domain --json), path (pushover --json), or "
        "folder of a sweep (sweep --output).",
        "FILE|FOLDER",
    )
    scene: str | None = option(
        "SCENE",
        "Scene file, or name of a built-in scene, that was solved. Files hold a digest of their "
        "scene only; a folder has the scene that was varied.",
    )


@command_of(
    Claimed,
    "Exit code: 0 all that is claimed is proved; 2 bad input; 4 something is not proved.",
)
def prove_command(asked: Claimed) -> ExitCode:
    """Prove a result, a load domain, a path or a sweep again from the forces and mechanisms that it
    holds; numbers that were changed are not proved."""
    scene = None if asked.scene is None else scene_named(asked.scene)
    proof = prove(asked.file, scene)
    show(Text(one_line(proof.about)), *(Text(f"  {one_line(row)}") for row in proof.rows))
    if proof.is_proved:
        return ExitCode.SOLVED
    if not proof.missing:
        raise InputError(f"{asked.file}: it claims nothing that could be proved")
    missing, claims = proof.missing, len(proof.checks) - len(proof.of("not looked at"))
    return refuse(
        ExitCode.NOT_GOOD_ENOUGH,
        f"{asked.file}: {len(missing)} of {counted(claims, 'claim')} not proved; the first is "
        f"{missing[0]}",
    )

"""``cvxlimit prove``: what a file or a folder says, proved again from what it holds."""

from __future__ import annotations

from dataclasses import dataclass

from rich.text import Text

from cvxlimit.base.lines import one_line
from cvxlimit.cli.options import Command
from cvxlimit.cli.report import counted
from cvxlimit.cli.shell import ExitCode, refuse, show
from cvxlimit.cli.solving import scene_named
from cvxlimit.errors import InputError
from cvxlimit.proving.prove import prove


@dataclass(frozen=True, kw_only=True)
class ProveCommand(Command):
    """Prove a result, a load domain, a path or a sweep again from the forces and mechanisms that it
    holds; numbers that were changed are not proved.

    Arguments
    ---------
    file : FILE|FOLDER
        Result file (solve, settle --json), load domain (domain --json), path (pushover --json), or
        folder of a sweep (sweep --output).

    Model
    -----
    scene : SCENE
        Scene file, or name of a built-in scene, that was solved. Files hold a digest of their scene
        only; a folder has the scene that was varied.

    Exit code
    ---------
    0 all that is claimed is proved; 2 bad input; 4 something is not proved.
    """

    file: str
    scene: str | None = None

    def run(self) -> ExitCode:
        scene = None if self.scene is None else scene_named(self.scene)
        proof = prove(self.file, scene)
        show(Text(one_line(proof.about)), *(Text(f"  {one_line(row)}") for row in proof.rows))
        if proof.is_proved:
            return ExitCode.SOLVED
        if not proof.missing:
            raise InputError(f"{self.file}: it claims nothing that could be proved")
        missing, claims = proof.missing, len(proof.checks) - len(proof.of("not looked at"))
        return refuse(
            ExitCode.NOT_GOOD_ENOUGH,
            f"{self.file}: {len(missing)} of {counted(claims, 'claim')} not proved; the first is "
            f"{missing[0]}",
        )

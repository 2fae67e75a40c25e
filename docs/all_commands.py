"""The command line with all its commands, for Typer; else each comes when it is asked for."""

from cvxlimit.cli.main import COMMANDS, add, app

for name in COMMANDS.places:
    add(name)

__all__ = ["app"]

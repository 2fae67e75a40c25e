"""What several commands are asked for, as Typer takes it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SceneName = Annotated[
    str,
    typer.Argument(
        metavar="SCENE", help="Scene file, or name of a built-in scene.", show_default=False
    ),
]

SurfaceName = Annotated[
    str, typer.Option(metavar="conic|octagon|K-gon", help="Yield surface, as for solve.")
]

ResultFile = Annotated[
    Path | None, typer.Option(metavar="OUT", help="Write the result to this JSON file.")
]

"""Geometry files read as scenes: OBJ, STL, PLY, glTF, COMPAS assemblies and tables of boxes."""

from cvxlimit.io.geometry.bodies import Body
from cvxlimit.io.geometry.export import EXPORTS, export
from cvxlimit.io.geometry.importing import (
    LOWEST,
    READERS,
    Imported,
    import_geometry,
    read_bodies,
    sketch,
)

__all__ = [
    "EXPORTS",
    "LOWEST",
    "READERS",
    "Body",
    "Imported",
    "export",
    "import_geometry",
    "read_bodies",
    "sketch",
]

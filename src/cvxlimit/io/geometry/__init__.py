"""Geometry files read as scenes: OBJ, STL, PLY, glTF, COMPAS assemblies and tables of boxes."""

from cvxlimit.io.geometry.bodies import Body
from cvxlimit.io.geometry.importing import (
    LOWEST,
    READERS,
    Imported,
    import_geometry,
    read_bodies,
    sketch,
)

__all__ = ["LOWEST", "READERS", "Body", "Imported", "import_geometry", "read_bodies", "sketch"]

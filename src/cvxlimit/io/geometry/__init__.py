"""Geometry files read as scenes: OBJ, STL, PLY, glTF, COMPAS assemblies and tables of boxes."""

from cvxlimit.io.geometry.bodies import Body
from cvxlimit.io.geometry.importing import READERS, Imported, import_geometry, read_bodies

__all__ = ["READERS", "Body", "Imported", "import_geometry", "read_bodies"]

"""Geometry files read as scenes: OBJ, STL, PLY, glTF, COMPAS assemblies and tables of boxes."""

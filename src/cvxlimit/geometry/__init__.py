"""Shapes: blocks, the polygons they touch in, and how contacts are found.

To read: ``mesh.py``, closed surfaces as arrays; ``polygons.py``, plane geometry. Then a block:
``polyhedra.py`` refuses what is none, ``blocks.py`` has the record, ``solids.py`` mends meshes of
programs, with ``shells.py`` and ``orientation.py``, which say on which side the material lies. Then
``detection.py`` with its stages, in order: ``facets.py``, ``nearby.py``, ``facing.py``,
``outlines.py`` (with ``overlays.py``), ``joints.py``, ``curved.py``, ``penetration.py``. What
comes out: ``contacts.py`` with ``strengths.py``, ``nearmisses.py`` and ``lumped.py``.
"""

"""Geometry files read as scenes: OBJ, STL, PLY, glTF, OFF, DXF, COMPAS, 3DEC, tables of boxes.

Its doors are ``cvxlimit.readers`` (formats, by suffix), ``cvxlimit.commands`` (``import``),
``cvxlimit.files`` and ``cvxlimit.readings``. To read: ``reading.py``, from bodies to a scene;
``files.py``, from files to bodies, and ``bodies.py``, what a reader returns; ``obj.py``,
``off.py``, ``tables.py``, ``dxf.py``, ``gltf.py`` with ``gltf_data.py``, ``meshes.py``,
``threedec.py`` and ``compas.py``, the formats; ``sheets.py``, ``digits.py`` and ``supports.py``,
what is made of bodies; ``compas_results.py``, the way back; ``command.py``.
"""

from cvxlimit.base.doors import Offered

OFFERED: Offered = {
    "cvxlimit.commands": {"import": "cvxlimit.extensions.importing.command:ImportCommand"},
    "cvxlimit.files": {
        "Imported": "cvxlimit.extensions.importing.reading:Imported",
        "import_geometry": "cvxlimit.extensions.importing.reading:import_geometry",
        "read_bodies": "cvxlimit.extensions.importing.files:read_bodies",
    },
    "cvxlimit.readers": {
        ".obj": "cvxlimit.extensions.importing.obj:read_obj",
        ".json": "cvxlimit.extensions.importing.compas:read_json",
        ".csv": "cvxlimit.extensions.importing.tables:read_table",
        ".off": "cvxlimit.extensions.importing.off:read_off",
        ".dxf": "cvxlimit.extensions.importing.dxf:read_dxf",
        **dict.fromkeys((".dat", ".3ddat"), "cvxlimit.extensions.importing.threedec:read_threedec"),
        **dict.fromkeys((".stl", ".ply"), "cvxlimit.extensions.importing.meshes:read_mesh"),
        **dict.fromkeys((".glb", ".gltf"), "cvxlimit.extensions.importing.gltf:read_gltf"),
    },
    "cvxlimit.readings": {
        "scene_from_compas": "cvxlimit.extensions.importing.reading:of_compas",
        "solution_to_compas": "cvxlimit.extensions.importing.compas_results:results",
    },
}

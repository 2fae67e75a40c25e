"""Reading and writing scene files and result files: JSON, UTF-8, without loss.

Two formats, ``cvxlimit-scene`` and ``cvxlimit-result``, both version 1. Everything given by
the user comes back bit for bit. Geometry of other programs is read by :func:`import_geometry`. What
cannot be read is refused with an
:class:`~cvxlimit.errors.InputError` of one line; nothing is padded, clipped or guessed.
"""

from cvxlimit.io.geometry import Imported, export, import_geometry, read_bodies
from cvxlimit.io.results import read_result, result_from_dict, result_to_dict, write_result
from cvxlimit.io.scenes import read_scene, scene_from_dict, scene_to_dict, write_scene

__all__ = [
    "Imported",
    "export",
    "import_geometry",
    "read_bodies",
    "read_result",
    "read_scene",
    "result_from_dict",
    "result_to_dict",
    "scene_from_dict",
    "scene_to_dict",
    "write_result",
    "write_scene",
]

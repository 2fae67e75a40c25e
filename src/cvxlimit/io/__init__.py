"""Reading and writing files of scenes, results and paths: JSON, UTF-8, without loss.

Three formats, ``cvxlimit-scene``, ``cvxlimit-result`` and ``cvxlimit-path``, all version 1.
Everything given by the user comes back bit for bit; :func:`json_schema` describes them. Geometry of
other programs is read by :func:`import_geometry`. What cannot be read is refused with an
:class:`~cvxlimit.errors.InputError` of one line; nothing is padded, clipped or guessed.
"""

from typing import Any

from cvxlimit.base.doors import Door
from cvxlimit.errors import InputError
from cvxlimit.io.exporting import export
from cvxlimit.io.results import read_result, result_from_dict, result_to_dict, write_result
from cvxlimit.io.scenes import (
    read_scene,
    scene_digest,
    scene_from_dict,
    scene_to_dict,
    write_scene,
)

__all__ = [
    "Imported", "export", "import_geometry", "json_schema", "read_bodies", "read_path",
    "read_result", "read_scene", "result_from_dict", "result_to_dict", "scene_digest",
    "scene_from_dict", "scene_to_dict", "write_path", "write_result", "write_scene",
]  # fmt: skip


def json_schema(kind: str = "scene") -> dict[str, Any]:
    """JSON Schema of a file of a scene, result or path, for editors and validators.

    It knows keys, kinds and numbers of entries; relations between entries (a support that is no
    block, an open mesh, a load on nothing) are checked by reading only. ``cvxlimit scenes
    --schema`` prints it. An editor applies it to files that name it under ``"$schema"``, a key that
    readers ignore.

    Parameters
    ----------
    kind : "scene", "result" or "path"

    Raises
    ------
    InputError
        For another kind.

    Example
    -------
    >>> json_schema()["required"]
    ['format', 'version', 'blocks', 'supports', 'friction', 'loads']
    """
    documents = Door("cvxlimit.documents")
    documents.check(kind)
    if kind not in documents:
        known = ", ".join(map(repr, documents))
        raise InputError(f"kind must be one of {known}, got {kind!r}")
    schema: dict[str, Any] = documents[kind].schema
    return schema


def __getattr__(name: str) -> Any:
    files = Door("cvxlimit.files")  # of extensions
    files.check(name, f"{__name__}.{name}")
    if (found := files.get(name)) is not None:
        return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

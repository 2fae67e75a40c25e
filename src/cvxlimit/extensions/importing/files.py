"""From geometry files to bodies: every file by the reader of its suffix, every body by a name.

A folder stands for its geometry files. Meshes that hold several bodies are separated, a body
without a name has its file's or a number, and of several of one name the later ones are numbered.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from cvxlimit.base.doors import Door
from cvxlimit.base.lines import one_line
from cvxlimit.errors import InputError
from cvxlimit.extensions.importing.bodies import Body, natural, separated
from cvxlimit.io.fields import file_prefix, refusals, shown

READERS: Mapping[str, Callable[[Path, list[str]], list[Body]]] = Door("cvxlimit.readers")
"""Readers by suffix, each called with a file and the list of notes on what is left out; other
distributions may add theirs."""

_BY_BLENDER = "open it in Blender, one object a stone, and export .glb or .obj"

UNREAD = {
    "3dm": "in Rhino, SelClosedPolysrf, then Export Selected as .obj, object names as OBJ objects",
    "skp": "in SketchUp, make a group of every stone, then File, Export, 3D Model as .glb or .obj",
    "ifc": "open it in Blender with Bonsai, or in FreeCAD, and export the stones as .glb or .obj",
    **dict.fromkeys(("fbx", "usd", "usda", "usdc", "usdz", "dae", "3ds", "wrl"), _BY_BLENDER),
    "blend": "in Blender, File, Export as .glb, with the stones selected, or as .obj",
    "dwg": "in the drawing program, save as .dxf in text, of 2000 or later",
    "step": "in FreeCAD, select the solids, and export them as .obj; or as .stl, one file a stone",
    "stp": "in FreeCAD, select the solids, and export them as .obj; or as .stl, one file a stone",
    "iges": "in FreeCAD, make solids of the faces, and export them as .obj",
    "igs": "in FreeCAD, make solids of the faces, and export them as .obj",
    "3mf": "in the slicer or in Blender, export the bodies as .stl or .obj",
}
"""Formats by suffix that hold stones and are not read, and how to get from there to one that is."""

_IGNORED = (".mtl", ".bin", ".png", ".jpg", ".jpeg", ".txt", ".md")
"""Companions of geometry files, silently left alone in a folder."""

Paths = str | os.PathLike[str] | Iterable[str | os.PathLike[str]]


def bodies_in(paths: Paths) -> list[Body]:
    """All bodies of files and folders, by name."""
    return unique(read(files_in(paths), []), [])


def files_in(paths: Paths) -> list[Path]:
    """The files given, and those of folders in the order of their names, b2 before b10.

    Raises
    ------
    InputError
        If nothing is given, or a folder holds no geometry, or something besides.
    """
    given = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not given:
        raise InputError("no geometry is given: name a file or a folder")
    result = []
    for path in map(Path, given):
        if not path.is_dir():
            result.append(path)
            continue
        visible = [p for p in path.iterdir() if not p.name.startswith(".")]
        inside = sorted(visible, key=lambda p: natural(p.name))
        known = [p for p in inside if p.suffix.lower() in READERS]
        strange = [p for p in inside if p not in known and p.suffix.lower() not in _IGNORED]
        if not known or strange:
            what = f"also holds {strange[0].name!r}" if strange else "holds no geometry"
            raise InputError(
                f"{one_line(str(path))}: the folder {one_line(what)}; give a folder of "
                f"{', '.join(READERS)} files only"
            )
        result += known
    return result


def read(files: Sequence[Path], notes: list[str]) -> list[Body]:
    """The bodies of files, each with a name: its own, or its number; of several files with a body
    each they have the names of the files."""
    result: list[Body] = []
    for file in files:
        bodies = read_bodies(file, notes)
        for i, body in enumerate(bodies, 1):
            name = body.name or f"b{i}"
            if len(bodies) == 1 and (len(files) > 1 or not body.name):
                name = file.stem
            result.append(replace(body, name=name))
    return result


def read_bodies(path: str | os.PathLike[str], notes: list[str] | None = None) -> list[Body]:
    """All bodies in a geometry file, as given; meshes that hold several are separated. ``notes``
    gets a sentence on what is left out.

    Raises
    ------
    InputError
        If the file cannot be read or holds no body: one line that names it.
    """
    file = Path(path)
    with refusals(file_prefix(path)):
        reader = READERS.get(file.suffix.lower())
        if reader is None:
            kind = file.suffix.lower()[1:]
            if kind in UNREAD:
                raise InputError(f".{kind} files are not read: {UNREAD[kind]}")
            raise InputError(
                f"cannot tell the format from {file.suffix or file.name!r}: give a file that ends "
                f"in {', '.join(READERS)}, or a folder of such files"
            )
        notes = [] if notes is None else notes
        bodies = reader(file, notes)
        if not any(len(body.faces) or body.is_box for body in bodies):
            raise InputError("the file holds no faces; export the blocks as meshes")
        result = []
        for body in bodies:
            parts = separated(body)
            result += parts
            if len(parts) > 1 and body.name:  # a file of one mesh has no name for it
                notes.append(
                    f"{shown(body.name)} holds {len(parts)} separate bodies: each is a block, "
                    f"{shown(parts[0].name)} to {shown(parts[-1].name)}"
                )
        return result


def unique(bodies: Sequence[Body], notes: list[str]) -> list[Body]:
    """The bodies under names that differ: later ones of a name are numbered."""
    seen, taken, renamed = Counter[str](), {body.name for body in bodies}, list[Body]()
    for body in bodies:
        name = body.name
        while seen[body.name] and name in taken:  # "a", "a", "a#2": the second one is "a#3"
            seen[body.name] += 1
            name = f"{body.name}#{seen[body.name]}"
        seen[body.name] = max(seen[body.name], 1)
        taken.add(name)
        renamed.append(replace(body, name=name))
    several = sum(times > 1 for times in seen.values())
    if several:
        notes.append(
            f"several blocks have the same name ({several} times): later ones are numbered #2 ..."
        )
    return renamed

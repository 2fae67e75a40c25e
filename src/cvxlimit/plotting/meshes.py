"""Blocks and contacts of a solution as pyvista meshes, for figures and tools of one's own."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from cvxlimit.extras import needed
from cvxlimit.plotting.vtu import vtu_files
from cvxlimit.solution import Solution


def to_pyvista(solution: Solution) -> Any:
    """A ``pyvista.MultiBlock`` with the meshes ``"blocks"`` and ``"contacts"``.

    They carry what the ``.vtu`` files carry: speeds, displacements, forces, openings ...; warp by
    ``"displacement"`` to see the mechanism.

    Raises
    ------
    InputError
        For a solution without its scene.
    ModelError
        If pyvista is not installed.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> meshes = to_pyvista(solve(builtin_scene("single-block")))
    >>> meshes["blocks"].n_cells, meshes["contacts"].n_cells
    (2, 1)
    """
    pyvista = needed("pyvista", "pyvista", "pyvista meshes")
    parts = vtu_files(solution.drawn_scene, solution)
    result = pyvista.MultiBlock()
    with tempfile.TemporaryDirectory(prefix="cvxlimit-") as folder:
        for name, content in zip(("blocks", "contacts"), parts, strict=True):
            path = Path(folder) / f"{name}.vtu"
            path.write_bytes(content)
            result[name] = pyvista.read(path)
    return result

"""Run notebooks and save their outputs: ``.venv/bin/python notebooks/execute.py NAME...``.

Without names, all of them. What depends on the day or the machine but says nothing (execution times
and counts of the kernel) is left out, so that a second run changes only what has changed.
"""

from __future__ import annotations

import base64
import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import nbclient
import nbformat
import numpy as np
from PIL import Image
from scipy.spatial import cKDTree

HERE = Path(__file__).parent
ROOT = HERE.parent


def main(names: list[str]) -> None:
    """Run and save notebooks by name, with or without ``.ipynb``."""
    paths = [HERE / f"{Path(name).stem}.ipynb" for name in names] or sorted(HERE.glob("*.ipynb"))
    for path in paths:
        notebook = nbformat.read(path, as_version=4)
        run(notebook)
        for picture in pictures(notebook):
            picture["image/png"] = smaller(picture["image/png"])
        nbformat.write(notebook, path)


def pictures(notebook: nbformat.NotebookNode) -> Iterator[dict[str, str]]:
    """Outputs with a picture, each by kind of content."""
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            if "image/png" in output.get("data", {}):
                yield output["data"]


def smaller(picture: str) -> str:
    """A picture (PNG in base64) in its 256 commonest colours: a third of the bytes.

    Areas and lines keep their colours exactly; only the soft edges of letters change a little.
    """
    pixels = np.array(Image.open(io.BytesIO(base64.b64decode(picture))).convert("RGB"))
    found, which, counts = np.unique(
        pixels.reshape(-1, 3), axis=0, return_inverse=True, return_counts=True
    )
    kept = found[np.argsort(counts)[-256:]]
    nearest = cKDTree(kept).query(found)[1].astype(np.uint8)  # Pillow's own is not exact
    image = Image.fromarray(nearest[which].reshape(pixels.shape[:2])).convert("P")
    image.putpalette(kept.astype(np.uint8).tobytes())
    file = io.BytesIO()
    image.save(file, "PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode()


def run(notebook: nbformat.NotebookNode, timeout: float = 300.0) -> None:
    """Run a notebook as readers and the tests do: in its own folder, with the package's sources."""
    paths = [str(ROOT / "src"), *filter(None, sys.path)]
    os.environ["PYTHONPATH"] = os.pathsep.join(paths)
    os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"
    client = nbclient.NotebookClient(
        notebook, timeout=timeout, kernel_name="python3", record_timing=False
    )
    client.execute(cwd=str(HERE))
    notebook.metadata["language_info"] = {"name": "python"}


if __name__ == "__main__":
    main(sys.argv[1:])

"""The README as a package index can show it; Hatchling calls this when it builds.

A package index shows pictures and follows links only at absolute addresses: it hosts none of a
package's files, and takes out pictures that are written into the text (``data:`` addresses, SVG).
So the address at which the sources of a release can be read stands in ``pyproject.toml``,

    [tool.hatch.metadata.hooks.custom]
    sources = "https://.../v{version}"

or is given when a release is built,

    CVXLIMIT_SOURCES=https://.../v0.2.0 .venv/bin/python -m build

and every relative link gets it in front. Without either, as long as the project has no public
address, pictures become their captions, and links their words with the place in the source
distribution: nothing points nowhere. ``.ci/shown.py`` says what an index shows of a built package.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PICTURE = re.compile(r"!\[([^\]]*)\]\((?!https?:)([^)#\s]+)\)")
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:|#)([^)\s]+)\)")


class IndexReadme(MetadataHookInterface):
    """Sets the field ``readme`` of the project's metadata."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by Hatchling."""
        text = (Path(self.root) / "README.md").read_text("utf-8")
        address = os.environ.get("CVXLIMIT_SOURCES", self.config.get("sources", ""))
        address = address.replace("{version}", version_in(Path(self.root)))
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": on_an_index(text, address),
        }


def version_in(root: Path) -> str:
    """The version that is being built: Hatchling has not read it yet."""
    text = (root / "src" / "cvxlimit" / "versions.py").read_text("utf-8")
    found = re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE)
    assert found, "src/cvxlimit/versions.py has no __version__"
    return found[1]


def on_an_index(text: str, address: str = "") -> str:
    """The README with absolute addresses, or without any that are relative.

    Raises
    ------
    ValueError
        If the address is not one that an index shows pictures from.
    """
    if not address:
        text = PICTURE.sub(r"*\1: picture `\2` of the source distribution.*", text)
        return LINK.sub(r"\1 (`\2` of the source distribution)", text)
    if not address.startswith("https://"):
        raise ValueError(f"CVXLIMIT_SOURCES must begin with https://, got {address!r}")
    base = address.rstrip("/")
    return LINK.sub(rf"[\1]({base}/\2)", PICTURE.sub(rf"![\1]({base}/\2)", text))

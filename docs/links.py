"""Links between files of the sources, as links between pages of the site.

In the sources a link leads from file to file, so that it works where they are shown. What is no
page of the site becomes its words.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

PAGES = {
    "README.md": "/index.md",
    "CONTRIBUTING.md": "/_made/contributing.md",
    "CHANGELOG.md": "/_made/changelog.md",
}
"""Pages of the site that have another place in the sources."""

LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?![a-z]+:|#)([^)#\s]*)(#[^)\s]*)?\)")
CODE = re.compile(r"(^[ ]*(`{3,}|~{3,}).*?^[ ]*\2[ ]*$|`[^`\n]+`(?!\]))", re.DOTALL | re.MULTILINE)


def for_site(text: str, folder: str) -> str:
    """The text of a file in ``folder`` of the sources, its links those of the site; code stays.

    >>> for_site("[how](../CONTRIBUTING.md), [where](../src/cvxlimit)", "docs")
    '[how](/_made/contributing.md), where'
    """
    parts, at = [], 0
    for code in CODE.finditer(text):
        parts += [LINK.sub(lambda found: link(found, folder), text[at : code.start()]), code[0]]
        at = code.end()
    return "".join(parts) + LINK.sub(lambda found: link(found, folder), text[at:])


def link(found: re.Match[str], folder: str) -> str:
    """One link; within a page, or to another file of ``docs``, it is right as it is."""
    words, target, anchor = found[1], found[2], found[3] or ""
    file = normal(PurePosixPath(folder) / target)
    if file in PAGES:
        return f"[{words}]({PAGES[file]})"
    if file.startswith("notebooks/") and file.endswith(".ipynb"):
        return f"[{words}](/_made/{file})"
    if file.startswith("docs/"):
        return f"[{words}](/{file.removeprefix('docs/')}{anchor})"
    return words


def normal(path: PurePosixPath) -> str:
    """Without ``..``: from the root of the sources."""
    parts: list[str] = []
    for part in path.parts:
        if part == ".." and parts:
            parts.pop()
        elif part != ".":
            parts.append(part)
    return "/".join(parts)


def on_source_read(app: Sphinx, name: str, content: list[str]) -> None:
    """Pages of ``docs`` that are text: those made from other files have been through this."""
    if Path(app.env.doc2path(name)).suffix == ".md" and not name.startswith("_made/"):
        content[0] = for_site(content[0], str(PurePosixPath("docs") / PurePosixPath(name).parent))


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", on_source_read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

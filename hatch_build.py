"""The compiled part, and the README as a package index can show it; Hatchling calls both when it
builds.

What is written in C (:data:`SOURCES`) becomes extensions for the stable interface of
Python 3.11, built by setuptools. Without a C compiler, or for ``CVXLIMIT_COMPILED=no``, the package
is built without them: other solvers then do the same, in more time.

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
import runpy
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
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
    text = (root / "src" / "cvxlimit" / "base" / "versions.py").read_text("utf-8")
    found = re.search(r'^__version__ = "(.+)"$', text, re.MULTILINE)
    assert found, "src/cvxlimit/base/versions.py has no __version__"
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


SOURCES = ("cvxlimit/solvers/cholesky.c", "cvxlimit/extensions/blockcone/interior.c")
FLAGS = {"unix": ["-O3", "-g0", "-fno-math-errno"], "msvc": ["/O2", "/std:c11"]}
STABLE = "0x030B0000"  # Python 3.11


class Compiled(BuildHookInterface[Any]):
    """Builds the extensions into the wheel, or, for an editable install, beside their sources."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by Hatchling."""
        if self.target_name != "wheel" or os.environ.get("CVXLIMIT_COMPILED") == "no":
            return
        self._room = tempfile.TemporaryDirectory()
        for source in SOURCES:
            path = Path(self.root) / "src" / source
            if not path.exists():  # of an extension that is left out
                continue
            built = compiled(path, Path(self._room.name))
            if built is None:
                self.app.display_warning(f"{source} could not be compiled: slower ways do the same")
            elif version == "editable":
                beside = path.with_name(built.name)
                beside.unlink(missing_ok=True)  # a process may hold the one before
                beside.write_bytes(built.read_bytes())
            else:
                place = Path(source).with_name(built.name).as_posix()
                build_data["force_include"][str(built)] = place
                platform = re.sub(r"[-.]", "_", sysconfig.get_platform())
                build_data |= {"pure_python": False, "tag": f"cp311-abi3-{platform}"}


def compiled(source: Path, folder: Path, flags: Sequence[str] = ()) -> Path | None:
    """The extension ``_NAME`` of NAME.c in the folder, or None if it cannot be built here; further
    ``flags`` go to compiler and linker."""
    from setuptools import Distribution, Extension
    from setuptools.errors import BaseError, CCompilerError

    name = f"_{source.stem}"
    package = next(path for path in source.parents if path.name == "cvxlimit")
    solvers = package / "solvers"  # which has the headers
    digest = runpy.run_path(str(solvers / "sources.py"))["digest"](source)
    extension = Extension(
        name,
        [str(source)],
        include_dirs=[str(solvers)],
        define_macros=[("Py_LIMITED_API", STABLE), ("SOURCES", f'"{digest}"')],
        extra_compile_args=[*FLAGS["msvc" if sys.platform == "win32" else "unix"], *flags],
        extra_link_args=[*flags],
        py_limited_api=True,
    )
    command = Distribution({"name": name, "ext_modules": [extension]}).get_command_obj("build_ext")
    command.build_lib, command.build_temp = str(folder), str(folder / "objects")
    try:
        command.ensure_finalized()
        command.run()
    except (BaseError, CCompilerError, OSError):
        return None
    return next(folder.glob(f"{name}.*"), None)

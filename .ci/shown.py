"""What a package index shows of built packages: ``python .ci/shown.py PACKAGE...``.

Renders the long description of wheels and source distributions as the index does, and fails if a
picture of the README is not shown at an absolute address.
"""

from __future__ import annotations

import email
import re
import sys
import tarfile
import zipfile
from pathlib import Path

from readme_renderer import markdown

PICTURE = re.compile(r"!\[[^\]]*\]\(([^)\s]+)\)")
README = Path(__file__).parents[1] / "README.md"


def description(package: Path) -> str:
    """The long description in a package's metadata."""
    if package.suffix == ".whl":
        with zipfile.ZipFile(package) as wheel:
            (name,) = (n for n in wheel.namelist() if n.endswith(".dist-info/METADATA"))
            text = wheel.read(name).decode()
    else:
        with tarfile.open(package) as sdist:
            top = package.name.removesuffix(".tar.gz")
            file = sdist.extractfile(f"{top}/PKG-INFO")
            assert file is not None
            text = file.read().decode()
    return str(email.message_from_string(text).get_payload())


def main(packages: list[str]) -> None:
    """Fail unless every picture is shown."""
    wanted = PICTURE.findall(README.read_text("utf-8"))
    for package in map(Path, packages):
        page = markdown.render(description(package)) or ""
        shown = re.findall(r'<img[^>]* src="(https://[^"]+)"', page)
        missing = [name for name in wanted if not any(at.endswith(name) for at in shown)]
        if missing or not wanted:
            sys.exit(f"{package.name}: the index does not show {missing or 'any picture'}")
        sys.stdout.write(f"{package.name}: {' '.join(shown)}\n")


if __name__ == "__main__":
    main(sys.argv[1:])

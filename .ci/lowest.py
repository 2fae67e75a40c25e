"""The lowest versions that pyproject.toml allows, as constraints: ``python .ci/lowest.py``."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
BOUND = re.compile(r"^([\w.-]+)\s*(?:\[[^]]*\])?\s*>=\s*([\w.]+)")


def lowest(project: str) -> Iterator[str]:
    """``name==version`` of every requirement of a pyproject.toml that has a lower bound."""
    tables = tomllib.loads(project)["project"]
    extras = tables.get("optional-dependencies", {}).values()
    for requirement in sorted({*tables["dependencies"], *(r for extra in extras for r in extra)}):
        if found := BOUND.match(requirement):
            yield f"{found[1]}=={found[2]}"
        elif not requirement.startswith(f"{tables['name']}["):
            raise SystemExit(f"{requirement} has no lower bound")


if __name__ == "__main__":
    sys.stdout.write("\n".join(lowest(PROJECT.read_text("utf-8"))) + "\n")

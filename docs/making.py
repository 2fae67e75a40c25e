"""What the site shows and the package knows: commands, pictures, scenes, columns, notebooks."""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import nbformat
from links import for_site
from scenes import make_scenes

from cvxlimit import builtin_scene, solve
from cvxlimit.plotting import PICTURES

HERE = Path(__file__).parent
FIGURES = HERE / "figures"


def make_all(root: Path, made: Path) -> None:
    """Write everything into the folder ``made``, which is not kept with the sources."""
    (made / "notebooks").mkdir(parents=True, exist_ok=True)
    keep(made / "commands.md", commands())
    keep(made / "gallery.md", gallery())
    make_scenes(made)
    solution = solve(builtin_scene("single-block"))
    for kind in ("contacts", "blocks"):
        keep(made / f"columns-{kind}.md", columns(solution.to_dataframe(kind)))
    for name in ("CONTRIBUTING.md", "CHANGELOG.md"):
        keep(made / name.lower(), for_site((root / name).read_text("utf-8"), "."))
    sources = sorted((root / "notebooks").glob("*.ipynb"))
    for source in sources:
        keep(made / "notebooks" / source.name, notebook(source))
    keep(made / "notebooks.md", shown(sources, made / "notebooks"))
    for page in (made / "notebooks").glob("*.ipynb"):
        if page.name not in [source.name for source in sources]:
            page.unlink()


def keep(path: Path, text: str) -> None:
    """Write, unless that is what the file says already: then Sphinx need not read it again."""
    if not path.exists() or path.read_text("utf-8") != text:
        path.write_text(text, "utf-8")


def notebook(path: Path) -> str:
    """A notebook with the links of its text changed to those of the site."""
    content = nbformat.read(path, as_version=4)
    for cell in content.cells:
        if cell.cell_type == "markdown":
            cell.source = for_site(cell.source, "notebooks")
        for output in cell.get("outputs", ()):
            if not output.get("metadata", True):  # some tools write null, which MyST fails on
                output.pop("metadata")
            if output.output_type in ("display_data", "execute_result"):
                output.setdefault("metadata", nbformat.from_dict({}))
    return str(nbformat.writes(content))


def shown(sources: Sequence[Path], folder: Path) -> str:
    """A card for every notebook: its title, its first sentences, and the last picture it drew."""
    cards = ["::::{grid} 1 1 2 3\n:gutter: 2\n"]
    for source in sources:
        cells = nbformat.read(source, as_version=4).cells
        title, said, *_ = next(c.source for c in cells if c.cell_type == "markdown").split("\n\n")
        data = [output.get("data", {}) for c in cells for output in c.get("outputs", ())]
        drawn = [base64.b64decode(each["image/png"]) for each in data if "image/png" in each]
        picture = folder / f"{source.stem}.png"
        if not picture.exists() or picture.read_bytes() != drawn[-1]:
            picture.write_bytes(drawn[-1])
        name = f"/_made/notebooks/{source.stem}"
        line = for_site(said.replace("\n", " "), "notebooks")
        head = f":::{{grid-item-card}} [{title.removeprefix('# ')}]({name}.ipynb)"
        cards.append(f"{head}\n![]({name}.png)\n\n{first_sentences(line)}\n:::")
    return "\n".join([*cards, "::::\n"])


def first_sentences(text: str, least: int = 60) -> str:
    """As many as it takes to say something.

    >>> first_sentences("Coulomb's cone is round. Linear programming needs facets. Which?", 30)
    "Coulomb's cone is round. Linear programming needs facets."
    """
    found = ""
    for sentence in re.findall(r".*?[.?!](?= |$)|.+$", text):
        found += sentence
        if len(found) >= least:
            break
    return found.strip()


def commands() -> str:
    """What the command line knows of itself, by Typer's own command."""
    asked = ["typer", str(HERE / "all_commands.py"), "utils", "docs", "--name", "cvxlimit"]
    done = subprocess.run([sys.executable, "-m", *asked], capture_output=True, check=True)
    return done.stdout.decode("utf-8")


def columns(table: Any) -> str:
    """The columns of a table of results, with their units, as a list of definitions."""
    units, said = table.attrs["units"], table.attrs["description"]
    return "\n".join(
        f"`{name}`{f' ({units[name]})' if name in units else ''}\n: {text}\n"
        for name, text in said.items()
    )


def gallery() -> str:
    """Every picture of a solution: what its function says, and an example; last those that move."""
    drawn = sorted(PICTURES, key=lambda kind: not (FIGURES / f"{kind}.png").exists())
    return "\n".join(
        [
            "::::{grid} 1 1 2 2\n:gutter: 2\n",
            *(card(kind, PICTURES[kind]) for kind in drawn),
            "::::\n",
        ]
    )


def card(kind: str, make: Callable[..., Any]) -> str:
    """The first sentence of a picture's docstring over the picture."""
    said = (make.__doc__ or "").split("\n\n")[0]
    shown = f"![{kind}](/figures/{kind}.png)" if (FIGURES / f"{kind}.png").exists() else ""
    return f":::{{grid-item}}\n`{kind}`: {said}\n\n{shown}\n:::"

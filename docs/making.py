"""What the site shows and other tools write: the command line's help, and the notebooks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
from links import for_site
from typer.main import get_command

from cvxlimit.cli.main import app


def make_all(root: Path, made: Path) -> None:
    """Write everything into the folder ``made``, which is not kept with the sources."""
    (made / "notebooks").mkdir(parents=True, exist_ok=True)
    keep(made / "commands.md", commands())
    for name in ("CONTRIBUTING.md", "CHANGELOG.md"):
        keep(made / name.lower(), for_site((root / name).read_text("utf-8"), "."))
    sources = sorted((root / "notebooks").glob("*.ipynb"))
    for source in sources:
        keep(made / "notebooks" / source.name, notebook(source))
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


def commands() -> str:
    """One section per command, from what the command line knows of itself."""
    group: Any = get_command(app)
    sections = [section(name, command) for name, command in group.commands.items()]
    return "\n".join(sections)


def section(name: str, command: Any) -> str:
    """Title, usage, help, and what every argument and option does."""
    arguments = [p.metavar for p in command.params if is_argument(p)]
    options = ["[OPTIONS]"] if len(arguments) < len(command.params) else []
    usage = " ".join(["cvxlimit", name, *arguments, *options])
    parts = [f"# cvxlimit {name}", plain(command.help), f"```text\n{usage}\n```"]
    parts += [definition(parameter) for parameter in command.params]
    if command.epilog:
        parts.append(plain(command.epilog))
    return "\n\n".join(parts) + "\n"


def definition(parameter: Any) -> str:
    """``--option VALUE`` and what it does, with its default."""
    terms = [] if is_argument(parameter) else [", ".join(parameter.opts)]
    terms += [parameter.metavar] if parameter.metavar else []
    text = plain(parameter.help or "")
    if parameter.show_default and isinstance(parameter.default, str):
        text += f" Default: `{parameter.default}`."
    return f"`{' '.join(terms)}`\n: {text}"


def is_argument(parameter: Any) -> bool:
    """True for what is given by its place, not by a name."""
    return not parameter.opts[0].startswith("-")


def plain(text: str) -> str:
    """Help without the line breaks of its source."""
    return " ".join(text.split())

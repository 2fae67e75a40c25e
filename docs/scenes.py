"""The gallery of built-in scenes: each is solved, drawn, and written as a page to turn.

Load factors and seconds are therefore always those of the code that builds the site.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from time import process_time

import cvxlimit
from cvxlimit import builtin_scene, solve
from cvxlimit.masonry import BUILTIN
from cvxlimit.plotting import mechanism_of
from cvxlimit.plotting.drawing import drawn

CARD = """:::{{grid-item-card}} {name}
![{name}, as it falls](/_made/pictures/{name}.png)

{said}

Load factor **{factor}**, {status}, in {seconds:.1g} s of CPU. Free blocks: {blocks};
contacts: {contacts}.

`solve(builtin_scene("{name}"))`, <a href="live/{name}.html">turn it and let it fall</a>
:::"""


def make_scenes(made: Path) -> None:
    """Write ``scenes.md``, its pictures and its pages, unless the package is as it was then."""
    stamp, state = made / "scenes.stamp", of_sources()
    if stamp.exists() and stamp.read_text("utf-8") == state:
        return
    for folder in ("pictures", "site/live"):
        (made / folder).mkdir(parents=True, exist_ok=True)
    cards = [card(name, made) for name in BUILTIN]
    grid = ["::::{grid} 1 2 2 3\n:gutter: 2\n", *cards, "::::\n"]
    (made / "scenes.md").write_text("\n".join(grid), "utf-8")
    stamp.write_text(state, "utf-8")


def card(name: str, made: Path) -> str:
    """Solve a scene; its picture, its page, and the text beside them."""
    started = process_time()
    solution = solve(builtin_scene(name))
    seconds = process_time() - started
    bare = replace(mechanism_of(solution.scene, solution), has_axes=False, bar=None)
    # Words are too small on a card.
    shown = drawn(bare, figsize=(3.4, 2.7), title="", legend=False)
    shown.savefig(made / "pictures" / f"{name}.png", dpi=150)
    solution.plot("page", made / "site" / "live" / f"{name}.html")
    return CARD.format(
        name=name,
        said=BUILTIN[name].description,
        factor=f"{solution.load_factor:.4f}",
        status=solution.status.value,
        blocks=solution.blocks,
        contacts=solution.contacts,
        seconds=seconds,
    )


def of_sources() -> str:
    """A short name for the state of the package and of this file."""
    files = [Path(__file__), *sorted(Path(cvxlimit.__file__).parent.rglob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()

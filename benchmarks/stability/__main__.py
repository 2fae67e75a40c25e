"""``python -m benchmarks.stability [run | write | list]``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from benchmarks.stability.families import FAMILIES
from benchmarks.stability.peers import ask_peer
from benchmarks.stability.studies import STUDIES

console = Console(highlight=False, markup=False, soft_wrap=True)
DOCS = Path(__file__).parents[2] / "docs" / "evidence"


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, then write the atlas; what is measured already is not measured again."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability", description=__doc__)
    parser.add_argument("action", nargs="?", default="all", choices=("all", "run", "write", "list"))
    parser.add_argument("--size", type=int, default=1100, help="scenes for our default")
    parser.add_argument("--first", type=int, default=0, help="first seed, for scenes never seen")
    parser.add_argument("--scale", type=int, default=1, help="multiplies numbers of blocks")
    parser.add_argument("--study", choices=[*STUDIES, "peer"], action="append",
                        help="only this one")  # fmt: skip
    parser.add_argument("--peer", type=Path, help="Python of an environment with compas_cra")
    parser.add_argument("--docs", type=Path, default=DOCS, help="folder of the atlas")
    given = parser.parse_args(arguments)
    if given.action == "list":
        for family in FAMILIES.values():
            console.print(f"{family.name:12} {family.what}")
    if given.action in ("all", "run"):
        _run([s for s in given.study or STUDIES if s != "peer"], given)
        if given.peer and not given.peer.exists():
            console.print(f"compas_cra is not asked: {given.peer} does not exist")
        elif given.peer:
            with console.status("peer") as status:
                ask_peer(given.peer, lambda text: status.update(f"peer: {text}"))
    if given.action in ("all", "write"):
        from benchmarks.stability.atlas import write

        for path in write(given.docs):
            console.print(str(path))


def _run(studies: Sequence[str], given: argparse.Namespace) -> None:
    for name in studies:
        ask, share = STUDIES[name]
        number = max(1, round(share * given.size))
        with console.status(name) as status:
            ask(number, given.scale, lambda text, name=name: status.update(f"{name}: {text}"),
                given.first)  # fmt: skip
        console.print(f"{name}: {number} scenes")


if __name__ == "__main__":
    main()

"""Small tables for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import islice

_MOST_ROWS = 10


def html_table(caption: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The first rows, and a row of dots where there are more; texts are data, never markup."""
    first = list(islice(rows, _MOST_ROWS + 1))
    shown = [*first[:_MOST_ROWS], ["\u2026"] * len(head)] if len(first) > _MOST_ROWS else first
    cells = [[f"<td>{escape(text)}</td>" for text in row] for row in shown]
    lines = [[f"<th>{escape(text)}</th>" for text in head], *cells]
    body = "".join(f"<tr>{''.join(line)}</tr>" for line in lines)
    return f"<table><caption>{escape(caption)}</caption>{body}</table>"

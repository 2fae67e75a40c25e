"""Which scenes a study asks about, and under what key it keeps what it saw."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from benchmarks.stability.families import FAMILIES, samples
from benchmarks.stability.records import Table

Tell = Callable[[str], object]


def asked(
    number: int, scale: int, table: Table | None, tell: Tell, first: int = 0
) -> Iterator[tuple[str, int]]:
    """Families and seeds, from seed ``first`` on, of scenes that are not in the table yet."""
    for k, (family, seed, _) in enumerate(samples(number, scale, first), 1):
        if table is None or key_of(family, seed, scale) not in table:
            tell(f"{k} of {number}: {family} {seed}")
            yield family, seed


def key_of(family: str, seed: int, scale: int) -> str:
    """The key of a scene's records.

    >>> key_of("walls", 3, 1), key_of("walls", 3, 2)
    ('walls-3', 'walls-3x2')
    """
    assert family in FAMILIES
    return f"{family}-{seed}" + (f"x{scale}" if scale > 1 else "")

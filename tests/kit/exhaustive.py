"""Which of many parameters every run tries; the others wait for ``pytest -m exhaustive``."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """One row of parameters that only the exhaustive run tries."""
    return pytest.param(*values, marks=pytest.mark.exhaustive)


def mostly_slow(values: Iterable[Any], fast: Collection[Any]) -> list[Any]:
    """All of them, each but the ``fast`` ones for the exhaustive run only."""
    values = list(values)
    assert all(value in values for value in fast), "a parameter that every run tries is gone"
    return [value if value in fast else slow(value) for value in values]

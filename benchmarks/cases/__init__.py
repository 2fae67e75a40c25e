"""Cases: scenes that can be built at any size. To add one, add a file with a ``CASE``."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass

from cvxlimit.scene import Scene

SIZES = (50, 150, 500, 1_900, 5_000, 16_452)
"""Contacts asked for; scenes come close."""


@dataclass(frozen=True)
class Case:
    """A scene swept in size.

    Attributes
    ----------
    name : str
    family : str
        Cases of one family share their charts.
    build : callable
        From the number of contacts asked for to a scene that has about as many.
    sizes : tuple of int
        Sizes at which a few methods show how they grow.
    study : tuple of int
        Sizes at which all methods are measured: time against error.
    interaction : bool
        True if torsion-shear-bending interaction is the subject.
    """

    name: str
    family: str
    build: Callable[[int], Scene]
    sizes: tuple[int, ...] = SIZES
    study: tuple[int, ...] = (150, 1_900)
    interaction: bool = False


def all_cases() -> dict[str, Case]:
    """Every file's case, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    cases = [importlib.import_module(f"{__name__}.{name}").CASE for name in names]
    return {case.name: case for case in cases}

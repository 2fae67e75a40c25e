"""Linear algebra kernels of a library that comes with CVXOPT."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path

_VARIABLE = "OPENBLAS_CORETYPE"

_KERNELS = {"avx512dq": "SkylakeX", "avx2": "Haswell"}
"""OpenBLAS's names of its kernels, by the instructions they need, the fastest first."""


def load_cvxopt() -> None:
    """Load CVXOPT, if it is there, with kernels that suit the processor.

    Its wheels hold an OpenBLAS of 2021, which takes processors younger than itself for a Pentium 4:
    CHOLMOD then needs up to twice the time. It reads the variable once, when CVXOPT is loaded, and
    CVXPY does that. What a user has set stands.
    """
    if "cvxopt" in sys.modules or _VARIABLE in os.environ or (kernel := _kernel()) is None:
        return
    os.environ[_VARIABLE] = kernel
    try:
        with suppress(Exception):  # whoever needs it says that it is not there
            import_module("cvxopt")
    finally:
        del os.environ[_VARIABLE]


def _kernel() -> str | None:
    with suppress(OSError), Path("/proc/cpuinfo").open(encoding="utf-8") as lines:  # Linux alone
        flags = next((line.split() for line in lines if line.startswith("flags")), [])
        return next((name for flag, name in _KERNELS.items() if flag in flags), None)
    return None

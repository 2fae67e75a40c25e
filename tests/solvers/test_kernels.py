"""CVXOPT's BLAS gets kernels that the processor can run, and nothing else changes."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

_LOADED = """
import cvxlimit
from contextlib import suppress
with suppress(ImportError):
    import cvxopt
from threadpoolctl import threadpool_info
print(*(lib["architecture"] for lib in threadpool_info() if "cvxopt" in lib["filepath"]))
"""


def _said(code: str, **variables: str) -> str:
    others = {k: v for k, v in os.environ.items() if k != "OPENBLAS_CORETYPE"}
    run = [sys.executable, "-c", code]
    done = subprocess.run(run, env=others | variables, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_environment_stays_as_it_was() -> None:
    code = "import os; old = dict(os.environ); import cvxlimit; print(old == dict(os.environ))"
    assert _said(code) == "True"


def test_kernel_that_a_user_asks_for_stands() -> None:
    if not _said(_LOADED):
        pytest.skip("no CVXOPT with an OpenBLAS of its own")
    assert _said(_LOADED, OPENBLAS_CORETYPE="Prescott") == "Prescott"

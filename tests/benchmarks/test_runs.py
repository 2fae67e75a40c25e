"""Runs in processes of their own: crashes, hangs and limits are failures with their reason."""

from __future__ import annotations

import os
import signal
import sys
import threading
from functools import partial

import numpy as np
import pytest
from benchmarks.machine import fitted_exponent
from benchmarks.rows import Rows
from benchmarks.runs import Limits, Stopped, apart, run_apart

from cvxlimit import builtin_scene
from cvxlimit.errors import ModelError
from cvxlimit.extensions.studies.models import Model, Row
from cvxlimit.model.formulations import resultants
from exhaustive import slow

LIMITS = Limits(600.0)
"""Seconds that no run needs, however busy the machine is."""


class Misbehaving(Model):
    """Fails in the way it is told to."""

    def __init__(self, name: str, how: str) -> None:
        super().__init__(name, "misbehaving")
        self.how = how

    def measure(self, scene) -> Row:
        if len(scene.contacts) > 1 or self.how == "crash":
            if self.how == "crash":
                os.kill(os.getpid(), signal.SIGSEGV)
            if self.how == "hang":
                signal.pause()
            if self.how == "memory":
                np.ones(int(1e12))
            if self.how == "raise":
                raise ZeroDivisionError("by\nnought")
        status = "infeasible" if self.how == "no answer" else "optimal"
        factor = None if self.how == "no answer" else 0.4
        return Row(status=status, load_factor=factor, total=0.1)


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("how", "reason"),
    [
        slow("crash", "SIGSEGV"),
        slow("hang", "time limit of 4 s"),
        slow("memory", "emory"),  # ended, or a MemoryError where the system gives no more
        ("raise", "ZeroDivisionError: by nought"),
        slow("no answer", "no load factor: infeasible"),
    ],
)
def test_failures_become_rows(how, reason):
    limits = Limits(4.0) if how == "hang" else LIMITS
    failure = run_apart(Misbehaving("bad", how), builtin_scene("stack"), limits)
    assert failure.failed
    assert reason in failure.reason


@pytest.mark.skipif(sys.platform != "linux", reason="memory is looked at on Linux only")
@pytest.mark.parametrize("gigabytes", [0.01, 0.05])
def test_a_limit_too_small_for_the_libraries_is_named(gigabytes):
    """NumPy, SciPy and CVXPY take more than 0.1 GB when they are loaded."""
    failure = run_apart(Model("cvxlimit"), builtin_scene("stack"), Limits(600.0, gigabytes))
    assert failure.reason == f"memory limit of {gigabytes:g} GB"


@pytest.mark.exhaustive
def test_memory_of_a_run_is_its_own():
    found = run_apart(Model("cvxlimit"), builtin_scene("stack"), LIMITS)
    assert not found.failed
    assert found.load_factor == pytest.approx(0.4, rel=1e-5)
    assert found.memory is None or 20.0 < found.memory < 1e4


def test_what_cannot_be_sent_is_refused_by_name():
    model = Model("mine", formulation=partial(resultants, lock=threading.Lock()))
    with pytest.raises(ModelError, match="'mine' cannot be sent"):
        run_apart(model, builtin_scene("single-block"), LIMITS)


@pytest.mark.exhaustive
def test_functions_that_no_module_holds_are_sent_by_value():
    model = Model("mine", formulation=lambda contacts: resultants(contacts))
    found = run_apart(model, builtin_scene("single-block"), LIMITS)
    assert not found.failed
    assert found.load_factor == pytest.approx(0.4, rel=1e-5)


@pytest.mark.exhaustive
def test_the_environment_of_a_process_is_its_own():
    assert apart(partial(os.getenv, "ONLY_THERE"), LIMITS, {"ONLY_THERE": "yes"}) == "yes"
    assert os.getenv("ONLY_THERE") is None
    with pytest.raises(Stopped, match="ValueError"):
        apart(partial(int, "three"), LIMITS)


def test_rows_survive_and_half_a_row_does_not(tmp_path):
    """As a run leaves them that is killed while it writes."""
    file = tmp_path / "new" / "rows.jsonl"
    rows = Rows(file, "scene", "moments")
    for value in (1.0, 2.0, np.inf):
        rows.add({"scene": "a", "moments": "signed", "value": value})
        rows.add({"scene": "b", "moments": "signed", "value": value})
    with file.open("a") as half:
        half.write('{"scene": "c", "mom')
    found = Rows(file, "scene", "moments")
    assert [row["value"] for row in found] == [None, None]
    found.add({"scene": "c", "moments": "signed", "value": 3.0})
    again = Rows(file, "scene", "moments")
    assert [row["scene"] for row in again] == ["a", "b", "c"]
    assert again.get({"scene": "c", "moments": "paper"}) is None


def test_fitted_exponent():
    sizes = np.array([500.0, 1900.0, 5000.0, 16452.0])
    noise = np.array([1.02, 0.99, 0.98, 1.01])
    assert fitted_exponent(sizes, 3e-4 * sizes**1.4) == pytest.approx(1.4)
    assert fitted_exponent(sizes, 3e-4 * sizes**1.4 * noise) == pytest.approx(1.4, abs=0.02)
    assert np.isnan(fitted_exponent([5.0, 5.0], [1.0, 2.0]))

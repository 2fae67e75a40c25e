"""For all tests: no property is judged by the clock, so that a busy machine fails none of them.

BLAS has one thread unless the environment says otherwise: the problems of the tests are small, and
threads that wait for one another would take half of the processor's time. Properties that say
nothing else are tried on forty random examples, others in every run.
"""

import os

import pytest
from hypothesis import HealthCheck, settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile(
    "no clock", max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("no clock")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Cases that a test names as exhaustive are marked so before any are chosen."""
    for item in items:
        for mark in item.iter_markers("exhaustive_cases"):
            if getattr(item, "callspec").id in mark.args:  # noqa: B009
                item.add_marker("exhaustive")

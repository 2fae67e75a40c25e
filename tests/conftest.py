"""For all tests: no property is judged by the clock, so that a busy machine fails none of them.

BLAS has one thread unless the environment says otherwise: the problems of the tests are small, and
threads that wait for one another would take half of the processor's time. Properties that say
nothing else are tried on twenty random examples, others in every run.
"""

import os
import re
from collections.abc import Generator
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import pytest
from hypothesis import HealthCheck, settings

from cvxlimit import extensions
from cvxlimit.errors import MissingExtension
from cvxlimit.extensions import SHIPPED, here

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile(
    "no clock", max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("no clock")

collect_ignore = ["kit/another"]  # somebody else's package, which registers what it offers


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--part", help="one part of the tests, by their names: 1/2, 2/2, or another share of them"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Of the part that is asked for, cases that a test names as exhaustive are marked so before any
    are chosen."""
    part, parts = map(int, (config.getoption("part") or "1/1").split("/"))
    items[:] = [item for item in items if crc32(item.nodeid.encode()) % parts == part - 1]
    for item in items:
        for mark in item.iter_markers("exhaustive_cases"):
            if getattr(item, "callspec").id in mark.args:  # noqa: B009
                item.add_marker("exhaustive")


MISSING = SHIPPED.keys() - here()
"""Extensions that are left out; the core's tests pass without any of them."""

_KIT = Path(__file__).with_name("kit")
_STUB = Path(extensions.__file__).parents[1].joinpath("__init__.pyi").read_text("utf-8")
_PUBLIC = {
    name: home
    for home, name in re.findall(r"^from \.extensions\.(\w+)\S* import (\w+)", _STUB, re.M)
}
"""The extension that each public name is of, where it is of one."""


@cache
def _needed(path: Path) -> frozenset[str]:
    """Extensions that a file of tests imports, itself or through what tests share."""
    text = path.read_text("utf-8")
    own = re.findall(r"\bcvxlimit\.(?:extensions\.)?(\w+)", text)
    for names in re.findall(r"^from cvxlimit import (\([^)]*\)|.*)$", text, re.M):
        own += [_PUBLIC[name] for name in re.findall(r"\w+", names) if name in _PUBLIC]
    shared = re.findall(r"^(?:from|import) (\w+)", text, re.M)
    kit = [_needed(_KIT / f"{name}.py") for name in shared if (_KIT / f"{name}.py").exists()]
    return frozenset({*own} & {*SHIPPED}).union(*kit)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Files that cannot be imported without what is left out."""
    is_test = collection_path.suffix == ".py" and collection_path.name.startswith("test_")
    return True if MISSING and is_test and _needed(collection_path) & MISSING else None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, Any, Any]:
    """A test that asks for what is left out, and is told so by an error of its own class, is left
    out as well; any other error is one."""
    try:
        return (yield)
    except MissingExtension as error:
        if error.extension not in MISSING:
            raise
        pytest.skip(str(error))

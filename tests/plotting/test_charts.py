"""Charts take what pictures take: axes or a size, a title, a legend, Matplotlib's settings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from tests.kit.pictures import assert_legible

from cvxlimit import Block, Load, Scene
from cvxlimit.compare import Comparison, Model
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.models import Row
from cvxlimit.studies import LoadDomain, compare_domains, load_domain

COLUMN = (3.4, 3.2)
"""Inches of a figure in a journal's column."""

BLOCKS = [
    Block.box("ground", (-1, -1, -1), (2, 2, 0)), Block.box("block", (0, 0, 0), (1, 1, 1.5), 20.0)
]  # fmt: skip
SCENE = Scene(BLOCKS, ["ground"], Load(acceleration=(1, 0, 0)), friction=0.4, name="block")
X, Y, Z = (Load(acceleration=axis) for axis in np.eye(3))
TRIED = (
    "cvxlimit", "cvxlimit/1e-8", "clarabel/1e-3", "clarabel/1e-6", "octagon/highs/1e-8",
)  # fmt: skip


def domain() -> LoadDomain:
    return load_domain(SCENE, {"x": X, "y": Y}, 0.1, progress=False)


def solid() -> LoadDomain:
    return load_domain(SCENE, {"x": X, "y": Y, "z": Z}, 0.3, progress=False)


def nested() -> Any:
    loads = {"x": X, "y": Y}
    return compare_domains(SCENE, ("conic", "octagon"), loads, 0.1, progress=False)


def comparison() -> Comparison:
    """Made up: no two methods of one time."""
    rows = [
        Row(method=name, line=Model.named(name).line, status="certified", total=0.1 * (k + 1.0),
            error=10.0 ** (-k - 2))
        for k, name in enumerate(TRIED)
    ]  # fmt: skip
    return Comparison("a wall of some length", tuple(rows))


CHARTS: dict[str, Callable[[], Any]] = {
    made.__name__: made for made in (domain, solid, nested, comparison)
}


@pytest.mark.exhaustive_cases("solid", "nested", "comparison")
@pytest.mark.parametrize("name", CHARTS)
def test_charts_take_what_pictures_take(name: str, tmp_path: Path) -> None:
    chart = CHARTS[name]()
    figure = chart.plot(figsize=COLUMN)
    assert figure.get_size_inches().tolist() == list(COLUMN)
    assert_legible(figure, 8)
    assert chart.plot(figsize=COLUMN, title="Mine").get_suptitle() == "Mine"
    bare = chart.plot(figsize=COLUMN, legend=False)
    assert not bare.legends
    assert bare.axes[0].get_legend() is None
    with rc_context({"font.size": 14.0}):
        larger = chart.plot(figsize=(7.0, 5.0)).axes[0].xaxis.label.get_size()
    assert larger == pytest.approx(
        1.4 * chart.plot(figsize=(7.0, 5.0)).axes[0].xaxis.label.get_size()
    )
    own = Figure(figsize=COLUMN)
    axes = own.add_subplot(projection="3d" if name == "solid" else None)
    assert chart.plot(ax=axes) is own
    with pytest.raises(InputError, match="give ax or figsize, not both"):
        chart.plot(ax=axes, figsize=COLUMN)


def test_files_of_domains() -> None:
    found = domain()
    own = Figure().add_subplot()
    with pytest.raises(InputError, match="save that with savefig"):
        found.plot("domain.png", ax=own)
    with pytest.raises(InputError, match="a page has no title: leave it out"):
        found.plot("domain.html", title="Mine")

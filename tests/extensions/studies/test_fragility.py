"""Fragility of draws: a known distribution, how often its interval covers, and no answers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from cvxlimit import Load, builtin_scene, sweep
from cvxlimit.errors import InputError, ModelError
from cvxlimit.masonry import rubble_wall, stack
from cvxlimit.studies import draws, fragility, read_sweep

ROCKS = 0.4
"""Length over height of the built-in block: it slides at its friction or rocks at this."""

FRICTION = stats.uniform(0.2, 0.4)


def known(demand: float) -> float:
    """Probability that min(friction, length / height) lies below the demand."""
    return float(FRICTION.cdf(demand)) if demand <= ROCKS else 1.0


def answers(*rows: tuple[float, float, str], least: float = np.nan) -> pd.DataFrame:
    table = pd.DataFrame(list(rows), columns=["lower", "upper", "status"])
    return table.assign(least_factor=least)


def test_a_sliding_block_has_the_distribution_of_its_friction() -> None:
    """Counted from the drawn frictions by hand; brackets are narrower than 1e-5."""
    drawn = draws({"friction": FRICTION}, 60, seed=3)
    table = sweep(builtin_scene("single-block"), drawn, progress=False)
    demands = np.array([0.0, 0.25, 0.3, 0.35, 0.45])
    found = fragility(table, demands)
    factors = np.minimum(drawn["friction"].to_numpy(), ROCKS)
    assert np.abs(factors[:, None] - demands).min() > 1e-5  # no bracket holds a demand
    by_hand = (factors[:, None] < demands).sum(axis=0)
    assert found.surely.tolist() == found.perhaps.tolist() == by_hand.tolist()
    for demand, low, high in zip(demands, found.lower, found.upper, strict=True):
        assert low <= known(demand) <= high


@pytest.mark.parametrize("number", [5, 20, 60])
@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_the_interval_covers_any_probability_at_least_so_often(
    number: int, confidence: float
) -> None:
    """Without chance: the probability of each count, times whether its interval holds p."""
    counts = np.arange(number + 1)
    tables = [answers(*[(0, 0, "")] * k, *[(1, 1, "")] * (number - k)) for k in counts]
    ends = [fragility(table, 0.5, confidence) for table in tables]
    low, high = (np.array([getattr(e, side)[0] for e in ends]) for side in ("lower", "upper"))
    p = np.linspace(0.0, 1.0, 401)[:, None]
    covered = (stats.binom.pmf(counts, number, p) * ((low <= p) & (p <= high))).sum(axis=1)
    assert covered.min() >= confidence - 1e-12  # rounding of the sum


def test_the_interval_covers_in_a_seeded_experiment() -> None:
    """400 samples of 30 blocks by their closed form; three deviations of a binomial below 0.95."""
    rng, inside = np.random.default_rng(11), 0
    for _ in range(400):
        factors = np.minimum(FRICTION.rvs(30, random_state=rng), ROCKS)
        found = fragility(answers(*[(f, f, "certified") for f in factors]), 0.3)
        inside += bool(found.lower[0] <= known(0.3) <= found.upper[0])
    assert inside / 400 > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 400)


def test_brackets_that_hold_the_demand_count_on_both_sides() -> None:
    table = answers((0.1, 0.2, ""), (0.25, 0.35, ""), (0.4, 0.5, ""), (np.nan, np.nan, ""))
    found = fragility(table, [0.05, 0.3, 0.45])
    assert found.surely.tolist() == [0, 1, 2]
    assert found.perhaps.tolist() == [1, 3, 4]
    exact = [stats.binomtest(k, 4).proportion_ci() for k in (1, 3)]
    assert (found.lower[1], found.upper[1]) == (exact[0].low, exact[1].high)


def test_a_demand_that_is_just_reached_is_carried() -> None:
    assert fragility(answers((0.3, 0.3, "")), 0.3).perhaps.tolist() == [0]


def test_answers_without_a_load_factor() -> None:
    """Stacks that fall by themselves, that their load presses down, and that cannot be built."""
    scenes = {
        "pushed": lambda: stack(3),
        "leans": lambda: stack(5, shift=(0.2, 0.0)),
        "pressed": lambda: stack(3, live=Load(acceleration=(0.0, 0.0, -1.0))),
        "apart": lambda: stack(5, shift=(0.6, 0.0)),
    }
    table = sweep(lambda name: scenes[name](), {"name": list(scenes)}, progress=False)
    found = fragility(table, [0.1, 10.0])
    assert found.surely.tolist() == [1, 2]  # what leans; what is pushed as well
    assert found.perhaps.tolist() == [2, 3]  # and perhaps what could not be built


def test_below_a_least_factor_a_structure_may_fall_as_well() -> None:
    table = answers((0.5, 0.5, "certified"), least=0.2)
    found = fragility(table, [0.1, 0.3, 0.6])
    assert (found.surely.tolist(), found.perhaps.tolist()) == ([0, 0, 1], [1, 1, 1])


def test_iterates_bound_nothing() -> None:
    drawn = {"friction": [0.3, 0.5]}
    table = sweep(builtin_scene("stack"), drawn, method="fixed-point", progress=False)
    found = fragility(table, 0.4)
    assert (found.surely.tolist(), found.perhaps.tolist()) == ([0], [2])


def test_rubble_drawn_by_its_seed(tmp_path: Any) -> None:
    """A wall turns over about its edge at thickness / height or slides at its friction; in courses
    it falls no later. Stored rows count as those in memory."""

    def rubble(seed: int) -> Any:
        push = Load(acceleration=(0.0, 1.0, 0.0))
        return rubble_wall(1.2, 0.9, 0.3, seed=seed, live=push)

    table = sweep(rubble, {"seed": range(6)}, path=tmp_path / "kept", progress=False)
    found = fragility(table, [0.01, 0.3 / 0.9 + 1e-6])
    assert found.perhaps.tolist() == [0, 6]
    stored = fragility(read_sweep(tmp_path / "kept"), found.demands)
    assert stored.to_dataframe().equals(found.to_dataframe())


def test_table_and_chart(tmp_path: Any) -> None:
    found = fragility(answers((0.1, 0.2, ""), (0.25, 0.35, "")), [0.15, 0.3], 0.9)
    table = found.to_dataframe()
    assert table["share_lower"].tolist() == [0.0, 0.5]
    assert table["share_upper"].tolist() == [0.5, 1.0]
    assert table.attrs == {"draws": 2, "confidence": 0.9}
    axes = found.plot().axes[0]
    assert axes.lines[0].get_ydata().tolist() == [0.5, 1.0]
    assert axes.lines[1].get_ydata().tolist() == [0.0, 0.5]
    found.plot(tmp_path / "curve.png")
    assert (tmp_path / "curve.png").stat().st_size > 0


GOOD = answers((0.1, 0.2, ""))


def interrupted() -> pd.DataFrame:
    table = GOOD.copy()
    table.attrs = {"is_interrupted": True, "variations": 40}
    return table


@pytest.mark.parametrize(
    ("table", "demands", "message"),
    [
        (GOOD.drop(columns="upper"), 0.1, "the table that sweep returns: it has no column 'upper'"),
        ([0.1], 0.1, "the table that sweep returns: it has no column 'lower'"),
        (GOOD.iloc[:0], 0.1, "the table that sweep returns: it has no row"),
        (interrupted(), 0.1, "was interrupted after 1 of 40 rows, which are no random choice"),
        (GOOD, [], "demands must be multiples of the live load, at least one"),
        (GOOD, -0.1, r"demands must be .* none negative, got \[-0.1\]"),
        (GOOD, [0.1, np.inf], "demands must be finite"),
        (GOOD, ["high"], "demands must be numbers, got .high."),
        (GOOD, None, "demands must be numbers, got None"),
    ],
)
def test_nonsense_is_refused(table: Any, demands: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fragility(table, demands)


def test_a_confidence_is_between_0_and_1() -> None:
    with pytest.raises(ModelError, match="confidence must be between 0 and 1, got 95"):
        fragility(GOOD, 0.1, 95)

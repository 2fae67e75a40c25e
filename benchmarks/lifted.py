"""Lower bounds without dilatancy in the plane by lifting: products of forces and rates as unknowns.

A solution without dilatancy pairs forces x = (1, n, V, alpha) with rates u of live power one and
slips p and q either way, so that what presses does not open and what slides is at its limit. All
of that is linear in the products Z = x y of forces and y = (u, p), q being p less the slip.

Letters, for N contacts of a planar scene; all are scaled (:class:`_Products`):

- n: compressions (2 N,) at the ends of contacts, V: shears (N,), alpha: the load factor;
- u: rates of blocks, p and q: slips (N,) of contacts one way and the other, none negative;
- s: the unit (N,) of shear in the problem, ``size``; R = mu N + c A: the most that friction bears;
- O u: openings (2 N,) at the ends of contacts, the first rows of ``flow``;
- a, b: the ``interval`` of load factors; Z(1), Z(alpha): the rows of Z for these entries of x.

The equations and inequalities of the lifted problem are

    equilibrium x every rate = 0,
    (n, R - s V, R + s V, alpha - a, b - alpha) x (O u, p, q) >= 0,
    n_i (O u)_i = 0,    (R + s V)_j p_j = 0,    (R - s V)_j q_j = 0,    Z(1) . live = 1,

with R = mu N + c A. Every solution with a <= alpha <= b satisfies it, so that the least Z(alpha) .
live is a lower bound: the first level of the reformulation-linearisation technique (Sherali and
Adams, 1990). No solution lies below it, so that it is the next a: windows narrow from below until
one no longer pays, and the narrower they are, the more their products tell.

**What is proved.** All rows are products of a solution's forces with rates, whatever size these
have. Multipliers of the rows combine them to Z(alpha) . live - F Z(1) . live, but for a residual,
so that for every solution

    (alpha - F) live . u  >=  -residual . Z  >=  -sum of r_k y_k,

with y_k >= 0 the openings and slips of joints, and r_k what the residual and all rounding can take
with any forces, which are bounded by a proof of their own. It is computed in NumPy from the
multipliers, and nothing else of the solver enters. Live power one alone does not bound rates, and
no multipliers can: where a joint is not pressed, rows let it slide both ways at once. So the bound
holds for all solutions whose joints open and slide by no more than :attr:`LiftedBound.rates` times
the live load's displacement, some 1e4 to 1e6 of it, where mechanisms of walls have some tens.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cvxpy as cp
import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog
from scipy.sparse.csgraph import shortest_path
from scipy.sparse.linalg import lsmr

from cvxlimit.base.arrays import EPSILON, BoolArray, FloatArray, IntArray
from cvxlimit.base.checks import count, not_negative
from cvxlimit.geometry.contacts import COLUMN, COMPONENTS
from cvxlimit.methods.driver import Run
from cvxlimit.methods.least_thrust import LeastThrust
from cvxlimit.model.program import LimitProgram
from cvxlimit.proof.certificate import Certifier
from cvxlimit.proof.minorant import minorant
from cvxlimit.reductions.choice import Reductions

_LOSS = 1e-5
"""What the bound leaves to residuals of its multipliers, relative."""

_WORTH = 0.1
"""Share of the gap that a window must close for a further one, which takes as long: with less, a
solution lies in it that the search has not found, or no window of this kind will close it."""

_REFINED = 2000
"""Steps of least squares in which multipliers are refined; each takes as long as one product."""

_WIDER = 1e-4
"""By how much the interval ends above the lowest solution known, relative, whose own error would
leave nothing in it."""

_TIGHT = 1e-10, 1e-7
"""Tolerances of HiGHS: the tightest that it takes, and its own where it ends without an optimum."""

_ROUGH = 1e-6
"""What rounding may change of a pseudo-inverse, far more than it does."""


@dataclass(frozen=True)
class Lifted:
    """How the lifted problem is stated and solved.

    Attributes
    ----------
    radius : int or None
        Products are taken of joints so many blocks apart at most; None takes all. Fewer are faster
        and weaker.
    seconds : float
        After which HiGHS ends without a bound.
    """

    radius: int | None = None
    seconds: float = 60.0

    def __post_init__(self) -> None:
        if self.radius is not None:
            count(self.radius, 0, "radius")
        not_negative(self.seconds, "seconds")


@dataclass(frozen=True)
class LiftedBound:
    """No solution without dilatancy has a load factor from ``start`` up to ``load_factor``, unless
    its joints open and slide in all by more than ``rates`` times the displacement of the live load
    (in the mean over the load; openings and slips at the ends of joints, twice each).

    ``load_factor`` is ``start`` where nothing was found, and ``note`` says why. ``seconds`` were
    taken in all.
    """

    load_factor: float
    start: float
    rates: float
    seconds: float
    note: str

    @property
    def is_bound(self) -> bool:
        """True if more was found than was known."""
        return self.load_factor > self.start

    def __str__(self) -> str:
        """What the bound rests on, or why there is none."""
        if not self.is_bound:
            return self.note
        return (
            f"unless joints open and slide, in all, by more than {self.rates:.2g} times the "
            "displacement of the live load"
        )


@dataclass(frozen=True, eq=False)
class _Products:
    """A planar problem, scaled, as rows on forces x = (1, n, V, alpha) and on y = (u, p).

    ``equilibrium`` (r, x) is zero. ``strength`` (4 n, x) is not negative: compressions, R - s V and
    R + s V; ``flow`` (4 n, y) likewise: openings, q and p, each zero where its like among the
    strengths is not. ``joint`` (4 n,) says of which contact they are, ``size`` (n,) is s, and
    ``live`` (y,) gives the power of the live load.
    """

    equilibrium: sp.csr_array
    strength: sp.csr_array
    flow: sp.csr_array
    live: FloatArray
    joint: IntArray
    size: FloatArray

    @classmethod
    def of(cls, problem: LimitProgram) -> _Products | None:
        """Returns the rows of a problem; None if it is not planar or has several laws of
        friction."""
        program, model = problem.program, problem.model
        n = len(model.contacts)
        if program.cones or list(model.start) != ["n", "V"] or program.nonneg != 4 * n:
            return None
        rows = sp.hstack([sp.csr_array(-program.right[:, None]), program.matrix], format="csr")
        equilibrium, strength = rows[: program.zero], -rows[program.zero :]
        shear = slice(1 + 2 * n, 1 + 3 * n)
        friction = strength[2 * n :, shear].toarray()
        size = friction[n:].diagonal()
        if not np.array_equal(friction, np.vstack([-np.diag(size), np.diag(size)])):
            return None
        openings, slips = equilibrium[:, 1 : 1 + 2 * n].T, equilibrium[:, shear].T
        each = sp.eye_array(n)
        # shear does the power of slips, s (p - q), against them: R + s V is zero where p is not
        flow = sp.vstack(
            [
                sp.hstack([openings, sp.csr_array((2 * n, n))]),
                sp.hstack([sp.diags_array(-1.0 / size) @ slips, each]),
                sp.hstack([sp.csr_array(slips.shape), each]),
            ],
            format="csr",
        )
        live = np.append(equilibrium[:, [-1]].toarray().ravel(), np.zeros(n))
        joint = np.concatenate([model.contact[: 2 * n], np.arange(n), np.arange(n)])
        return cls(equilibrium, sp.csr_array(strength), flow, live, joint, size)

    @property
    def shape(self) -> tuple[int, int]:
        """The shape of Z: number of forces x by number of rates y."""
        return self.strength.shape[1], self.flow.shape[1]


def lifted_bound(run: Run, start: float, upper: float, settings: Lifted) -> Iterator[LiftedBound]:
    """Lower bounds of all solutions without dilatancy from ``start`` on, in the plane: one of every
    window, so that an interruption leaves those found; or why there is none.

    Parameters
    ----------
    run : Run
        A planar scene of some 45 contacts at most; its surfaces with one law of friction, facets or
        cones.
    start : float
        A bound that is known, as :func:`.least_thrust.lower_bound` finds it.
    upper : float
        Load factor of the lowest solution known, above ``start``.
    """
    since = time.perf_counter()

    def result(note: str, factor: float = start, rates: float = np.inf) -> LiftedBound:
        return LiftedBound(factor, start, rates, time.perf_counter() - since, note)

    if not start < upper < np.inf:
        yield result("there is nothing between the bounds that are known")
        return
    with run.clock.phase("compile"):
        found = Reductions.of(run.assemblage, run.surfaces, model="least")
        found = replace(found, mirror=None, loaded=None)
        weight, at = cp.Parameter(len(run.contacts)), cp.Parameter()
        pressing = LimitProgram(
            found.assemblage, run.surfaces, reduction=found.best(), goal=LeastThrust(weight, at)
        )
        problem = LimitProgram(found.assemblage, run.surfaces, reduction=found.best())
        products = _Products.of(problem)
    if products is None:
        yield result("the lifted problem is for scenes in a plane, with one law of friction")
        return
    scaling = found.assemblage.scaling
    weight.value, at.value = -np.ones(len(run.contacts)), upper / scaling.load_factor(1.0)
    most = _largest_compression(run, pressing, start, (1.0 + _WIDER) * upper)
    if not np.isfinite(most):
        yield result("joints may press each other without end")
        return
    unit = scaling.load_factor(1.0)
    lowest, rates, note = start, np.inf, "the lifted problem does not raise the bound"
    while True:
        lift = _Lift(
            products,
            (lowest / unit, (1.0 + _WIDER) * upper / unit),
            _near(problem, settings.radius),
        )
        run.tell(f"lifted problem: {lift.inequalities.shape[0]:,} products of forces and rates")
        left = settings.seconds - (time.perf_counter() - since)
        with run.clock.phase("solve"):
            multipliers = lift.solved(left) if left > 0.0 else None
        if multipliers is None:
            note = "HiGHS found no optimum of the lifted problem, or not in the time"
            break
        with run.clock.phase("certify"):
            factor, taken = lift.checked(multipliers, most)
        factor = min((1.0 - _LOSS) * factor * unit, upper)
        if factor <= lowest:
            break
        gap, rise, lowest = upper - lowest, factor - lowest, factor
        rates = min(rates, _LOSS * factor / unit / taken)
        yield result("multipliers recomputed in NumPy", lowest, rates)
        if rise < _WORTH * gap or upper - lowest <= 2.0 * _LOSS * upper:
            break
    if lowest == start:
        yield result(note)


class _Lift:
    """The lifted linear program of one interval of load factors, in the entries of Z row by row."""

    def __init__(self, products: _Products, interval: tuple[float, float], near: BoolArray) -> None:
        self.products, self.interval = products, interval
        nx, ny = products.shape
        first, last = (sp.csr_array(([1.0], ([0], [k])), shape=(1, nx)) for k in (0, nx - 1))
        a, b = interval
        self.window = sp.vstack([last - a * first, b * first - last], format="csr")
        self.near = near
        strength, flow = products.strength, products.flow
        pairs = near[np.ix_(products.joint, products.joint)]
        tied = np.arange(len(products.joint))
        pairs[tied, tied] = False
        self.free = np.argwhere(pairs)
        live = sp.csr_array(products.live[None, :])
        self.equations = sp.vstack(
            [
                sp.kron(products.equilibrium, sp.eye_array(ny)),
                _products(strength, flow, np.stack([tied, tied], axis=1)),
                sp.kron(first, live),
            ],
            format="csr",
        )
        self.inequalities = sp.vstack(
            [
                _products(strength, flow, self.free),
                sp.kron(strength, live),
                sp.kron(self.window, flow),
            ],
            format="csr",
        )
        self.cost = sp.kron(last, live).toarray().ravel()

    def solved(self, seconds: float) -> tuple[FloatArray, FloatArray] | None:
        """Returns the multipliers of equations and of inequalities that HiGHS finds, or None."""
        right, until = np.zeros(self.equations.shape[0]), time.perf_counter() + seconds
        right[-1] = 1.0
        for tolerance in _TIGHT:
            answer = linprog(
                self.cost, A_ub=-self.inequalities, b_ub=np.zeros(self.inequalities.shape[0]),
                A_eq=self.equations, b_eq=right, bounds=(None, None), method="highs-ipm",
                options={"time_limit": seconds, "dual_feasibility_tolerance": tolerance,
                         "primal_feasibility_tolerance": tolerance},
            )  # fmt: skip
            seconds = until - time.perf_counter()
            if answer.status == 0 or seconds <= 0.0:
                break
        if answer.status != 0:
            return None
        return answer.eqlin.marginals, np.maximum(-answer.ineqlin.marginals, 0.0)

    def rest(self, multipliers: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Returns the residual (forces, rates) of the combination of rows by these multipliers,
        which should be Z(alpha) . live - F Z(1) . live."""
        equations, others = multipliers
        left = self.cost - self.equations.T @ equations - self.inequalities.T @ others
        return np.asarray(left).reshape(self.products.shape)

    def refined(self, multipliers: tuple[FloatArray, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Returns multipliers with next to no residual: those that are not zero are changed, by the
        least change in the sense of least squares."""
        equations, others = multipliers
        used = np.flatnonzero(others)
        rows = sp.vstack([self.equations, self.inequalities[used]], format="csr")
        change = lsmr(rows.T, self.rest(multipliers).ravel(), atol=0.0, btol=0.0, maxiter=_REFINED)
        moved = others.copy()
        moved[used] = np.maximum(moved[used] + change[0][len(equations) :], 0.0)
        return equations + change[0][: len(equations)], moved

    def checked(
        self, multipliers: tuple[FloatArray, FloatArray], most: float
    ) -> tuple[float, float]:
        """The bound F, and the most that residuals take per opening or slip, no joint being pressed
        by more than ``most``."""
        tries = [multipliers, self.refined(multipliers)]
        taken = [self._taken(each, most) for each in tries]
        best = int(np.argmin(taken))
        return float(tries[best][0][-1]), taken[best]

    def _taken(self, multipliers: tuple[FloatArray, FloatArray], most: float) -> float:
        """Returns the largest r_k: what residual and rounding take per opening or slip at most."""
        equations, others = multipliers
        products = self.products
        n, (_, ny) = len(products.size), products.shape
        size = abs(self.equations).T @ np.abs(equations) + abs(self.inequalities).T @ others
        size += np.abs(self.cost)
        rest = np.abs(self.rest(multipliers)) + EPSILON * size.reshape(products.shape)
        # no force is larger: 1, compressions, shears up to R / s, alpha
        forces = np.full(1 + 2 * n, most)
        forces[0] = 1.0
        shears = abs(products.strength[2 * n : 3 * n, : 1 + 2 * n]) @ forces / products.size
        forces = np.concatenate([forces, shears, [max(map(abs, self.interval))]])
        each = rest.T @ forces  # of every rate
        # rates of blocks from openings and slips, which they make
        ways, slips = ny - n, products.size[:, None] * products.flow[2 * n : 3 * n].toarray()
        made = np.vstack([products.flow[: 2 * n, :ways].toarray(), slips[:, :ways]])
        back = np.abs(np.linalg.pinv(made)) * (1.0 + _ROUGH)
        moved = each[:ways] @ back
        slid = products.size * moved[2 * n :] + each[ways:]
        return float(np.concatenate([moved[: 2 * n], slid]).max())


def _products(strength: sp.csr_array, flow: sp.csr_array, pairs: IntArray) -> sp.csr_array:
    """Rows of products of some rows of forces with some of rates."""
    one, two = strength[pairs[:, 0]], flow[pairs[:, 1]]
    counts = np.diff(one.indptr), np.diff(two.indptr)
    each = counts[0] * counts[1]
    row = np.repeat(np.arange(len(pairs)), each)
    inside = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
    i = one.indptr[row] + inside // counts[1][row]
    k = two.indptr[row] + inside % counts[1][row]
    column = one.indices[i].astype(np.int64) * flow.shape[1] + two.indices[k]
    shape = len(pairs), strength.shape[1] * flow.shape[1]
    return sp.csr_array((one.data[i] * two.data[k], (row, column)), shape=shape)


def _near(problem: LimitProgram, radius: int | None) -> BoolArray:
    """Pairs of contacts (n, n) whose blocks are at most so many contacts apart."""
    contacts, statics = problem.model.contacts, problem.assemblage.statics
    n = len(contacts)
    if radius is None:
        return np.ones((n, n), dtype=bool)
    row = statics.row_of_block
    ends = np.stack([row[contacts.a], row[contacts.b]])
    free = int(row.max()) + 1
    linked = (ends >= 0).all(axis=0)
    graph = sp.coo_array((np.ones(linked.sum()), ends[:, linked]), shape=(free, free)).tocsr()
    steps = shortest_path(graph, directed=False, unweighted=True)
    found = np.full((n, n), np.inf)
    for one in ends:
        for two in ends:
            both = np.minimum(one[:, None], two[None, :]) >= 0
            found = np.minimum(found, np.where(both, steps[np.ix_(one, two)], np.inf))
    return np.asarray(found <= radius)


def _largest_compression(run: Run, problem: LimitProgram, start: float, upper: float) -> float:
    """No contact is pressed by more at load factors between these, over the unit of force: no more
    than all together; infinite where that is not proved."""
    state, _ = run.try_solvers(problem.run, problem.ladder()[:2])
    if state.mechanism is None:
        return np.inf
    scaling = problem.scaling
    with run.clock.phase("certify"):
        each = np.zeros((len(run.contacts), len(COMPONENTS)))
        each[:, COLUMN["N"]] = -1.0
        certifier = Certifier(problem.assemblage, run.surfaces)
        line = minorant(certifier, each, state.mechanism * scaling.live)
    if line is None:
        return np.inf
    ends = [line.constant + line.slope * factor for factor in (start, upper)]
    return (line.rounding * upper - min(ends)) / scaling.force

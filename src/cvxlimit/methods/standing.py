"""Dead loads that stand only together with a part of the live load: the interval of factors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run
from cvxlimit.model.assemblage import Assemblage, Reduction
from cvxlimit.model.program import LimitProgram
from cvxlimit.model.statement import Stated
from cvxlimit.proof.certificate import Certifier
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate, LowerEnd
from cvxlimit.solution.bracket import REFERENCE, Bracket, rounded
from cvxlimit.surfaces.base import YieldSurface, times

SOLVERS_ASIDE = 2
"""Of the ladder, for questions beside the load factor: forces inside, and a mechanism that is exact
enough, are all that is asked for, and the first may fail where friction is huge."""


NO_FORCE = 1e8
"""Contact forces, over the dead load, beyond which it is rounding alone that could hold a block:
solvers leave missing openings of 1e-12 to 1e-10 of the rates in exact mechanisms."""


def largest_share(stated: Stated) -> Any:
    """Goal: the largest share, at most all, of the dead load that is carried beside any multiple of
    the live load, either way."""
    share = stated.own["share"] = stated.into.new(name="share", nonneg=True)
    stated.into.nonneg(1.0 - share)
    stated.dead = times(stated.dead, share)
    return share


class Held(NamedTuple):
    """A state of forces that carries the dead load with ``factor`` of the live load; None for both
    where there is none: contact forces below ``resistance`` could not hold it then (infinite if
    none could), and 0 if the question is open."""

    state: FloatArray | None
    factor: float
    resistance: float

    @property
    def remark(self) -> str:
        """Says, where no part of the live load holds the dead load, whether the live load turned
        round does."""
        if self.state is None:
            return "" if self.resistance else "whether a part of the live load holds it is open"
        if self.factor > 0.0:
            return ""
        return (
            f"{-self.factor:.3g} times the live load in the opposite direction would hold it: "
            "reverse the live load, and the answer is from which part of it on the structure stands"
        )


def held(
    run: Run,
    assemblage: Assemblage,
    surfaces: Sequence[YieldSurface],
    reduction: Reduction,
    certifier: Certifier,
) -> Held:
    """Finds with which part of the live load the dead load stands, or a proof that it does with
    none.

    An interior-point solver ends among all states that carry the whole dead load, so that the one
    it gives is well inside where any is. Where there is none, rates on which the live load does no
    power, and the dead load does, show it.
    """
    run.tell("checking whether a part of the live load holds the dead load")
    with run.clock.phase("compile"):
        problem = LimitProgram(
            assemblage, surfaces, formulation=run.formulation, reduction=reduction,
            goal=largest_share,
        )  # fmt: skip
    near = Held(None, 0.0, 0.0)
    for settings in (run.ladder or problem.ladder())[:SOLVERS_ASIDE]:
        state = run.solve(problem.run, settings)
        label = f"{settings}, dead load with a part of the live load"
        run.note(replace(state, load_factor=None), label)
        given, share = certifier.given(state), float(state.own.get("share", [0.0])[0])
        with run.clock.phase("certify"):
            if given is not None and state.load_factor is not None and share > 0.5:
                scale = share if certifier.strength.is_cone else 1.0
                near = Held(given / scale, state.load_factor / scale, 0.0)
                if certifier.offer_dead_state(given / scale, near.factor):
                    return near
            if state.mechanism is not None:
                resistance = _resistance(run, certifier, state.mechanism)
                if resistance > 0.0:
                    return Held(None, 0.0, resistance)
    return near if near.factor > 0.0 else Held(None, 0.0, 0.0)


def _resistance(run: Run, certifier: Certifier, mechanism: FloatArray) -> float:
    """Contact forces that it would take to hold the dead load on a mechanism on which no multiple
    of the live load of any natural size does: infinite if the flow rule allows it, 0 if it shows
    nothing."""
    statics, opened = certifier.statics, certifier.opened(mechanism)
    rates = opened.rates.ravel()
    power = float(statics.dead @ rates) - opened.dissipation
    live = abs(float(statics.live @ rates))
    if not (power > 0.0 and (live == 0.0 or run.is_boundless(power / live))):
        return 0.0
    if opened.is_allowed:
        return np.inf
    acting = float(np.abs(statics.dead).sum())
    resistance = power / opened.missing if opened.missing > 0.0 else np.inf
    return resistance if resistance > REFERENCE * acting else 0.0


def fallen(scene: Scene, rates: FloatArray, resistance: float = np.inf) -> str:
    """What happens to the free block on which the dead load does the most work, at rates (n, 6).
    Contact forces beyond ``resistance`` could hold it all the same; if they are of any size that
    could be meant, the sentence says so."""
    row = int((rates * scene.dead_forces).sum(axis=1).argmax())
    block, velocity = scene.blocks[scene.free[row]].id, rates[row, :3]
    gravity = np.array(scene.dead.gravity or (0.0, 0.0, 0.0))
    rises = float(velocity @ gravity) < -0.5 * float(np.linalg.norm(velocity))
    sentence = f"block {block!r} is lifted" if rises else f"block {block!r} falls"
    most = resistance / max(float(np.abs(scene.dead_forces[:, :3]).sum()), 1e-300)
    if most < NO_FORCE:
        sentence += f" (contact forces beyond {most:.1g} times the dead load could hold it)"
    return sentence


def refuse_an_interval(factor: float) -> None:
    """Refuses an interval for methods that ask for a dead load that stands alone.

    Raises
    ------
    ModelError
        If the dead load stands with ``factor`` times the live load instead, which is above 0.
    """
    if factor > 0.0:
        raise ModelError(
            "the dead load stands only together with a part of the live load, as with "
            f"{factor:.3g} times it, and this method needs a dead load that stands alone: method "
            "'convex' finds both ends; or make that part of the live load a part of the dead load, "
            "and count load factors from there"
        )


def lower_end(turned: Run, known: float) -> LowerEnd:
    """What a run with the live load turned round says about the least load factor; ``known`` is one
    that is carried."""
    best, found = turned.best, turned.best.bracket
    proofs = found.upper_is_proved, found.lower_is_proved
    bracket = Bracket(-found.upper, -found.lower, *proofs, found.least)
    factor = known if best.load_factor is None else bracket.clipped(-best.load_factor)
    return LowerEnd(factor, bracket, best.forces, turned.by_block(best.mechanism))


def about_the_lower_end(iterate: Iterate) -> Iterate:
    """Returns the iterate as it stands in the history: its numbers are those of another load."""
    label = f"{iterate.solver}, least load factor"
    return replace(iterate, solver=label, load_factor=None, lower=None, upper=None)


def told(answer: Answer, turned: Bracket, alone: str) -> str:
    """The interval in a sentence; ``turned`` is the bracket of the live load turned round, whose
    bounds are those of the lower end the other way about, and ``alone`` says what the dead load
    does without it."""
    said = f"the dead load stands only together with a part of the live load ({alone} without it)"
    if answer.load_factor is None and answer.lower_end is not None:
        least = rounded(answer.lower_end.load_factor, 6)
        said += f", and with any multiple of it from {least} on if sliding dilates joints"
    basis = turned.basis.replace("lower bound", "\0").replace("upper bound", "lower bound")
    return f"{said}; at the lower end {basis.replace(chr(0), 'upper bound')}"

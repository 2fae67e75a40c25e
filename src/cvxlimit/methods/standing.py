"""Dead loads that stand only together with a part of the live load: the interval of factors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.errors import ModelError
from cvxlimit.methods.answer import Answer
from cvxlimit.methods.driver import Run
from cvxlimit.scene import Scene
from cvxlimit.solution import Iterate, LowerEnd
from cvxlimit.solution.bracket import Bracket, rounded

NO_FORCE = 1e8
"""Contact forces, over the dead load, beyond which it is rounding alone that could hold a block:
solvers leave missing openings of 1e-12 to 1e-10 of the rates in exact mechanisms."""


def fallen(scene: Scene, rates: FloatArray, resistance: float = np.inf) -> str:
    """What happens to the free block on which the dead load does the most work, at rates (n, 6).
    Contact forces beyond ``resistance`` could hold it all the same; if they are of any size that
    could be meant, the sentence says so."""
    row = int((rates * scene.dead_forces).sum(axis=1).argmax())
    block, velocity = scene.blocks[scene.free[row]].id, rates[row, :3]
    gravity = np.array(scene.dead.gravity or (0.0, 0.0, 0.0))
    # more up than aside: joints that slide with dilatancy open by less than they slide
    rises = float(velocity @ gravity) < -np.sqrt(0.5) * float(np.linalg.norm(velocity))
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
    best, bracket = turned.best, turned.best.bracket.turned
    factor = known if best.load_factor is None else bracket.clipped(-best.load_factor)
    mechanism, reference = turned.by_block(best.mechanism), best.reference
    return LowerEnd(factor, bracket, best.forces, mechanism, reference and reference.turned)


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

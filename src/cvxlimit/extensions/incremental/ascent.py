"""From rest to the end of the curve: steps as long as its accuracy allows, and how it ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from cvxlimit.base.arrays import FloatArray
from cvxlimit.extensions.incremental.engine import Engine, Place
from cvxlimit.extensions.incremental.joints import Joints, Memory

LONGER, SHORTER = 2.0, 0.5
"""Most and least that the next step is, over this one: friction remembers its way, so that steps
grow no faster than the curve, by which they are measured, has been seen to bend."""

SHORT = 0.02
"""Share of the first step below which none is made shorter to follow a kink."""

STRAIGHT, FAR = 1e-9, 10.0
"""How far a step may turn the curve to count as none; and how much longer the next one is then."""

FLAT = 1e-8
"""Gain of a step, over the load factor, that is none: the state is a mechanism's to all digits."""

LEAST = 1e-6
"""Load factor, over the one expected, that counts as none."""

NEARLY = 0.05
"""Share of the load factor that twice the displacement would add at the last slope, below which it
is asked what is still to come."""

CLOSING, LARGE = 1e-6, 1e6
"""Closing of a point, over the largest motion of one, from which it is no rounding; and the motion
of the live load, over an elastic one, beyond which what closes does not count: a level curve ends
there at last."""

ENDLESS = 1e4
"""Load factor, over the dead load of the loaded blocks over their live load, beyond which there is
no limit."""

HALVINGS, LOOSE, STILL, LATE, SPENT = 12, 6, 4, 4, 10
"""Halvings of one step after which no way on is known; after which the load factor counts as level
where a stone may be loose, and where none is; how many there are, of all steps, where little is
still to come; and how often blocks are dragged on since the largest load factor until a curve that
has fallen by more than its tolerance counts as one that does not get there again."""


@dataclass(frozen=True, eq=False)
class Reached:
    """A state of the curve, and the displacement w of the live load since rest."""

    w: float
    place: Place
    before: FloatArray


@dataclass
class Ascent:
    """One way from rest; ``curve`` holds its states, ``end`` says how it ended.

    ``scale`` is a load factor to be expected, ``share`` how much of it, or of the largest one so
    far, a step may add; ``tolerance`` is for what is still to come, ``most`` for steps.
    """

    joints: Joints
    scale: float
    endless: float
    share: float = 0.06
    tolerance: float = 5e-3
    most: int = 150
    gaps: FloatArray | None = None
    curve: list[Reached] = field(default_factory=list)
    end: str = ""
    to_come: float | None = None
    slope: float = 0.0

    def __post_init__(self) -> None:
        self.engine = Engine(self.joints, self.gaps)

    @property
    def top(self) -> Reached:
        """The state with the largest load factor."""
        return max(self.curve, key=lambda each: each.place.alpha)

    def run(self) -> Iterator[Reached]:
        """Yields state after state, the one at rest first; ``end`` is set after the last one."""
        joints, engine = self.joints, self.engine
        rest = engine.at_rest()
        if rest is None:
            self.end = "rest"
            return
        memory, start = joints.after(rest.state, rest.memory), float(joints.live @ rest.d)
        here = Reached(0.0, rest, rest.d)
        self.curve.append(here)
        yield here
        # The first step: as far as the expected load factor's share moves the live load at rest.
        self.slope = engine.compliance()
        first = push = self.share * self.scale * self.slope
        fails, late, drags, is_near, is_free = 0, 0, 0, False, False
        while len(self.curve) <= self.most:
            found = self._step(here, memory, start + here.w + push)
            if found is None:
                # near the end little can come, and not every way on is worth halving steps for
                fails, push, late = fails + 1, push * SHORTER, late + is_near
                is_done = fails > (LOOSE if is_free else STILL) and self._is_level(here, here.w)
                if late >= LATE or is_done:
                    self.end = "plateau"
                    return
                if fails > HALVINGS or push < LEAST * here.w:
                    self.end = "lost"
                    return
                continue
            if self._bends(here, found[0], push) and push > SHORT * first:
                push *= SHORTER
                continue
            place, memory = found
            before, here = here, Reached(here.w + push, place, here.place.d)
            self.curve.append(here)
            most, fails = LONGER if fails == 0 else 1.0, 0
            yield here
            gain = place.alpha - before.place.alpha
            if place.alpha > self.endless:
                self.end = "endless"
                return
            drags = engine.drags if here is self.top else drags
            has_fallen = place.alpha < self.top.place.alpha * (1.0 - self.tolerance)
            is_spent = has_fallen and engine.drags - drags > SPENT
            if is_spent or self._is_flat(here, gain, push):
                self.end = "plateau"
                return
            is_free = abs(gain) <= FLAT * abs(place.alpha) and self._closes()
            is_near = not is_free and self._is_near(here, gain, push)
            push *= self._longer(before, here, gain, push, most)
        self.end = "steps"

    def _step(self, here: Reached, memory: Memory, w: float) -> tuple[Place, Memory] | None:
        """The state at w, and the memory after it; cohesion that breaks in the step is gone before
        it ends."""
        engine, joints, place = self.engine, self.joints, here.place
        while True:
            found = engine.newton(place.d, place.alpha, w, memory)
            if found is None:
                found = engine.dragged(place, w, memory)
            if found is None:
                return None
            broken = joints.broken(found.state, memory)
            after = joints.after(found.state, memory)
            if not broken.any():
                return found, after
            memory = replace(memory, intact=memory.intact & ~broken)

    @property
    def _allowed(self) -> float:
        """What a step may add to the load factor."""
        return self.share * max(self.top.place.alpha, self.scale / 4.0)

    def _last_slope(self) -> float | None:
        """Load factor over displacement in the last step; None before the first."""
        if len(self.curve) < 2:
            return None
        before, here = self.curve[-2:]
        return (here.place.alpha - before.place.alpha) / (here.w - before.w)

    def _bends(self, here: Reached, place: Place, push: float) -> bool:
        """Whether a step misses what the last one led to by more than a step may add: it has led
        over a kink of the curve, as where cohesion breaks."""
        slope = self._last_slope()
        if slope is None:
            return False
        return abs(place.alpha - here.place.alpha - slope * push) > self._allowed

    def _is_flat(self, here: Reached, gain: float, push: float) -> bool:
        """Whether a step that counts beside all displacement has gained nothing: what bears a part
        of the load is a mechanism then, and what bears none may be loose."""
        size = abs(here.place.alpha)
        is_flat = abs(gain) <= FLAT * max(size, LEAST * self.scale) and push >= 0.1 * here.w
        if is_flat and self._closes():
            return False
        if is_flat and size > LEAST * self.scale:
            self.to_come = here.place.alpha
            return True
        return is_flat and self._is_level(here, here.w / 4.0)

    def _closes(self) -> bool:
        """Whether points that are open close as it moves on: they will bear once they have."""
        before, here = (each.place.state.gap for each in self.curve[-2:])
        moved = np.where(self.joints.share > 0.0, here - before, 0.0)
        closing = (here > 0.0) & (moved < -CLOSING * np.abs(moved).max())
        is_small = self.curve[-1].w <= LARGE * self.scale * self.slope
        return is_small and bool(closing.any())

    def _is_near(self, here: Reached, gain: float, push: float) -> bool:
        """Whether little can come: asked where the curve has become flat, and rarely enough."""
        is_flat = gain * here.w <= NEARLY * abs(self.top.place.alpha) * push
        return is_flat and self._is_level(here, here.w / 4.0)

    def _is_level(self, here: Reached, asked_before: float) -> bool:
        """Whether the last state's friction could carry little more than the most so far; what was
        found up to a displacement is not found again."""
        if self._asked < asked_before:
            found = self.engine.to_come(here.place, here.w)
            self._asked, self.to_come = here.w, self.to_come if found is None else found
        top = self.top.place.alpha
        return self.to_come is not None and self.to_come - top <= max(
            self.tolerance * abs(top), LEAST * self.scale
        )

    _asked = 0.0

    def _longer(
        self, before: Reached, here: Reached, gain: float, push: float, most: float
    ) -> float:
        """How many times as long the next step is, at ``most``."""
        if len(self.curve) > 2 and abs(here.place.alpha) > LEAST * self.scale:
            last = self.curve[-3]
            slope = (before.place.alpha - last.place.alpha) / (before.w - last.w)
            if abs(gain - slope * push) <= STRAIGHT * abs(here.place.alpha):
                return FAR
        return float(np.clip(self._allowed / max(abs(gain), 1e-300), SHORTER, most))

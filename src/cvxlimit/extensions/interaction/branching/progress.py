"""How far branch and bound has come, what ends it before its bracket has closed, and both in words.

It knows the search and the clock of its run only by their figures, and changes neither.
"""

from __future__ import annotations

import numpy as np

from cvxlimit.extensions.interaction.branching.search import BranchAndBound
from cvxlimit.extensions.interaction.settings import BRACKET
from cvxlimit.methods.driver import Run

MORE_TIME = "a larger budget, in seconds, or a tolerance may narrow it"


def percent(width: float) -> str:
    """Returns a relative width in words."""
    return f"{100.0 * width:.3g} %" if np.isfinite(width) else "no bracket"


class Progress:
    """Branch and bound of a run, looked at before each of its steps.

    Parameters
    ----------
    run : Run
        The run; its clock starts to count for the search here.
    seconds : float
        Time for the search.
    ends_idle : bool
        Whether the search ends once it is idle, before its time is up.

    Attributes
    ----------
    is_idle : bool
        True if the gap has not become a hundredth less for ten seconds, or a third of the time so
        far where that is more.
    is_over : bool
        True if the time is up, or if the search ends as it is idle; few nodes never end it so,
        however slow the machine.
    is_exhausted : bool
        True if no node is left that could be split, and the gap is wider than asked for.
    said : str
        The nodes, problems and seconds so far, and what they did to the bracket; what ends the
        search at last, if that is not a closed bracket.
    """

    def __init__(self, run: Run, seconds: float, ends_idle: bool) -> None:
        self.run, self.seconds, self.ends_idle = run, seconds, ends_idle
        self.is_idle = self.is_over = self.is_exhausted = False
        self.said = ""
        self._start, self._width = run.clock.elapsed, run.best.bracket.width
        self._gap, self._gained = np.inf, 0.0  # the gap that was last a hundredth less, and when
        self._widths: list[tuple[float, float]] = []  # seconds so far, and the bracket's width

    def look(self, search: BranchAndBound) -> None:
        """Takes in where the search stands now."""
        bracket, spent = self.run.best.bracket, self.run.clock.elapsed - self._start
        self._widths.append((spent, bracket.width))
        gap = search.upper - search.lower
        if gap < 0.99 * self._gap or not np.isfinite(self._gap):
            self._gap, self._gained = gap, spent
        self.is_idle = spent - self._gained > max(BRACKET.budget, spent / 3.0)
        ends_idle = self.ends_idle and self.is_idle and search.nodes >= BRACKET.least_nodes
        self.is_over = spent > self.seconds or ends_idle
        self.is_exhausted = not search.can_go_on and gap > search.width
        nodes = f"{search.nodes} node{'s' * (search.nodes != 1)}"
        self.said = (
            f"branch and bound, {nodes} with {search.solves} problems in {spent:.1f} s: "
            f"from {percent(self._width)} to {percent(bracket.width)}"
        )
        if self.is_exhausted:
            self.said += "; it ended because no range of pressure centres is left that could be cut"
        elif self.is_over and search.can_go_on and not bracket.is_below_zero:
            self.said += f"; {self._ending()}"

    def _ending(self) -> str:
        """Returns what ended a search that could go on, and what more time would buy."""
        spent, width = self._widths[-1]
        if spent <= self.seconds:
            return "it ended because the bracket hardly narrowed any more"
        third = max(spent / 3.0, self._widths[0][0])
        before = [earlier for at, earlier in self._widths if at <= third][-1]
        share = 1.0 - width / before if np.isfinite(before) else 0.0
        gained = f"the last two thirds of it narrowed the bracket by {percent(share)} of its width"
        return f"its time was up: {gained}, and {MORE_TIME}"

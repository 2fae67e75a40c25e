"""What a solution says, the verdict first: for somebody who reads three lines.

Summary, report, page, notebook and tables take their words from here. A number that is not proved
is called what it is: the lowest that was found, the band of the last iterates, or no answer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cvxlimit.base.doors import Door
from cvxlimit.solution.bracket import TOLERANCE, Bracket, rounded, rounded_down, rounded_up
from cvxlimit.solution.from_rest import FromRest
from cvxlimit.solution.records import Status, ended_apart
from cvxlimit.solution.solution import Solution

DIGITS = 7
"""Most digits of a bracket's ends, as printed; wider ones have no more than they support."""

UNPROVED = 5
"""Digits of numbers that nothing bounds: those that another solver may find as well."""

_WITHOUT, _FROM_REST = "zero-dilatancy", "incremental"
_PAGE = "--report FILE.html"
_LEAST = "the lowest state that can be found, where beds are not true: --method zero-dilatancy"
REACHED = "the load reached from rest"
LOWEST = "the lowest load found if sliding opens no joint"
"""What to report where joints slide."""
WHERE_MET = "this, if it is reached from rest as well"
"""What to report where no joint of the proved mechanism slides, as leaves may part on the way."""


@dataclass(frozen=True, kw_only=True)
class Said:
    """A verdict in short rows and one sentence.

    Attributes
    ----------
    value : str
        The number, or that there is none.
    standing : str
        What holds it: its bracket, and how sure that is.
    headline : str
        One sentence for a report: what the number is, and what it is not.
    rows : tuple of (str, str)
        Further short rows, each true by itself: what slides, what else was found.
    report : str
        What to put in a report.
    option : str
        What to add on the command line to get that, or which extension is missing for it.
    """

    value: str
    standing: str
    headline: str
    rows: tuple[tuple[str, str], ...] = ()
    report: str = ""
    option: str = ""

    @property
    def method(self) -> str:
        """The method that ``option`` asks for; empty if none."""
        return self.option.partition("--method ")[2]


def said(solution: Solution) -> Said:
    """Returns what a solution says.

    Example
    -------
    >>> from cvxlimit import builtin_scene, solve
    >>> told = said(solve(builtin_scene("tuff-wall")))
    >>> print(told.value, told.standing.split()[-1])  # the bracket is between
    0.4230557 certified
    >>> told.rows
    (('sliding', '115 of 124 moving joints slide: without dilatancy it may fall at less'),)
    """
    status = solution.status
    if solution.lower_end is not None:
        return _interval(solution)
    if not status.has_answer:
        slides = solution.dilatancy is not None and solution.dilatancy.is_all
        return Said(
            value="none", standing=solution.standing,
            headline=f"no load factor: {solution.standing}",
            report=LOWEST if slides else "", option=_asking(_WITHOUT) if slides else "",
        )  # fmt: skip
    if solution.flow == "zero-dilatancy":
        return _members(solution)
    if solution.from_rest is not None and solution.load_factor is not None:
        return _from_rest(solution, solution.from_rest, solution.load_factor)
    if solution.bracket.has_any:
        return _bracketed(solution)
    return _iterated(solution)


def basis_of(solution: Solution) -> str:
    """The note without what has a row of its own: what slides, and faces taken as planes."""
    rest = solution.note
    for own in (solution.dilatancy, solution.lumped):
        rest = rest.removesuffix(str(own or "")).removesuffix("; ")
    return rest


def ends(bracket: Bracket) -> tuple[str, str]:
    """Both ends, rounded outwards to the digits that the bracket's width supports.

    >>> ends(Bracket(0.12603331, 0.12632289)), ends(Bracket(0.42305561, 0.42305579))
    (('0.12603', '0.12633'), ('0.4230556', '0.4230558'))
    """
    digits = _digits(bracket)
    return rounded_down(bracket.lower, digits), rounded_up(bracket.upper, digits)


def _digits(bracket: Bracket) -> int:
    """Two more digits than are certain, at most :data:`DIGITS`."""
    if not 0.0 < bracket.width < np.inf:
        return DIGITS
    return int(np.clip(2 - np.floor(np.log10(bracket.width)), 3, DIGITS))


def _sliding(solution: Solution, where: str = "") -> tuple[tuple[str, str], ...]:
    words = "" if solution.dilatancy is None else solution.dilatancy.row
    return (("sliding", where + words),) if words else ()


def _asking(method: str, before: str = "") -> str:
    """What asks for a method on the command line, or which extension is missing for it."""
    missing = Door("cvxlimit.methods").missing(method)
    return f"{before}--method {method}" if missing is None else str(missing)


def _joined(*words: str) -> str:
    return "; ".join(filter(None, words))


def _bracketed(solution: Solution) -> Said:
    """A load factor, a support's reaction or the value of an aim, between two bounds."""
    bracket, factor, unit = solution.bracket, solution.load_factor, solution.quantity_unit
    (low, high), status = ends(bracket), solution.standing
    what, unit = f"the {solution.quantity}", f" {unit}".rstrip()
    if solution.interaction != "none":
        what += f" with bending ({solution.moments} moments)"
    sure = "proved" if solution.is_proved else "recomputed"
    # Where bounds are apart they are the answer, and no number between them is.
    within = f"between {low} and {high}{unit}"
    value, standing = within, status
    rows = _sliding(solution)
    case = "if joints open as they slide" if rows else "for this model"
    headline = f"{what}, {sure} to lie {within} {case}"
    if not bracket.has_both:
        value = f"at least {low}" if np.isfinite(bracket.lower) else f"at most {high}"
        value += unit
        headline = f"{what} is {value} {case}, and the other bound is not known"
    elif factor is not None and solution.interaction == "none" and solution.status.is_good:
        value, standing = f"{rounded(factor, _digits(bracket))}{unit}", f"[{low}, {high}]  {status}"
    if not solution.status.is_good:
        wider = ", as the bracket is wider than was asked for" if bracket.has_both else ""
        headline += f": {status}{wider}"
    report, option = "this with its bracket; for a page to sign", _PAGE
    if rows:
        report, option = _from_rest_or_lowest(solution)
        headline = f"{headline}; {rows[0][1]}"
    elif solution.status.is_good and solution.interaction == "none":
        other, option = _from_rest_or_lowest(solution)
        report, option = (WHERE_MET, option) if other == REACHED else (report, _PAGE)
    return Said(
        value=value, standing=standing, headline=headline, rows=rows, report=report, option=option
    )


def _from_rest_or_lowest(solution: Solution) -> tuple[str, str]:
    """What to report where joints slide, and what asks for it: mortar that bears tension is not
    followed from rest."""
    scene = solution.solved_scene
    if scene is not None and scene.contacts.pulls:
        return LOWEST, _asking(_WITHOUT)
    surface = "" if solution.surface == "conic" else "--surface conic "
    return REACHED, _asking(_FROM_REST, surface)


def _interval(solution: Solution) -> Said:
    """Load factors from one end to the other: with less of the live load it falls as with more."""
    end, has_end = solution.lower_end, solution.load_factor is not None
    brackets = [] if end is None else [end.bracket]
    brackets += [solution.bracket] if has_end else []
    shown = " to ".join(f"[{low}, {high}]" for low, high in map(ends, brackets))
    what, *_ = solution.range_text.split(" and more")
    stands = f"it stands with {what} times the live load, and neither with less nor with more"
    if not has_end:
        how = "" if solution.is_answered else " if joints open as they slide"
        stands = f"it stands with any multiple of the live load from {what} on{how}, not with less"
    rows = (("interval", stands), *_sliding(solution, "at the upper end " if has_end else ""))
    headline = _joined(stands, solution.standing, *(words for _, words in rows[1:]))
    return Said(
        value=solution.range_text, standing=f"{shown}  {solution.standing}", headline=headline,
        rows=rows,
        report="both ends with their brackets; for a page to sign", option=_PAGE,
    )  # fmt: skip


def _members(solution: Solution) -> Said:
    """The lowest of the solutions without dilatancy that were found."""
    bracket, factor, members = solution.bracket, solution.load_factor, solution.members
    limits = _limits(bracket)
    if factor is None:
        none = "no solution without dilatancy was found, which does not say that there is none"
        return Said(
            value="none found", standing=str(solution.status), headline=_joined(none, limits),
            rows=(("solutions", limits),) if limits else (),
        )  # fmt: skip
    highest = members[-1].load_factor if members else factor
    span = " to ".join(dict.fromkeys(rounded(x, UNPROVED) for x in (factor, highest)))
    number = f"{len(members) or 1} found without dilatancy, {span}"
    rows = [("solutions", _joined(number, limits))]
    # what several searches say of each other, where the note has it
    rows += [("searches", part) for part in solution.note.split("; ") if " search" in part][:1]
    limited = f"of all such solutions {limits}" if limits else ""
    value, standing = rounded(factor, UNPROVED), "lowest found; not proved to be the least"
    found = "lowest load factor found at which it can fall if sliding opens no joint"
    headline = _joined(found, "not proved to be the least", limited)
    report, option = f"{value} as the lowest found, with these limits; for a page to sign", _PAGE
    if any(not member.is_settled for member in members[:1]):
        report, option = "nothing yet, as friction is at an angle to the slip; search on", "--seed"
    elif ended_apart(solution.searches):
        report, option = "nothing yet, as the searches ended apart; search on", "--searches"
    if bracket.lower_is_proved and factor - bracket.lower <= TOLERANCE * bracket.unit:
        standing = "the least, proved"
        headline = _joined("the least load factor if sliding opens no joint", limited)
        report, option = "this, which is proved; for a page to sign", _PAGE
    elif factor < 0.0:
        where = "0 lies between the" if highest >= 0.0 else "0 lies above all"
        depends = "whether it stands depends on the state of forces"
        rows.insert(0, ("dead load", f"{where} solutions found: {depends}"))
        headline = _joined(f"{where} solutions found ({span}): {depends}", limited)
    if not solution.status.is_good:
        standing = f"{solution.status}; {standing}"
    return Said(
        value=value, standing=standing, headline=headline, rows=tuple(rows), report=report,
        option=option,
    )  # fmt: skip


def _from_rest(solution: Solution, way: FromRest, factor: float) -> Said:
    """What a way from rest reached, where it ends with other settings, and its limits."""
    value, rows = rounded(factor, 4), [("end", way.end)]
    standing, wide = f"{solution.status}, which bounds nothing", way.undecided(factor)
    if wide:
        value, standing = wide, f"not decided, {standing}"
        rows.insert(0, ("not decided", f"its own way ends at {rounded(factor, 4)}, others apart"))
    if way.spread:
        rows.append(("spread", f"{way.spread_text} ({', '.join(x.what for x in way.spread)})"))
    if way.draws:
        rows.append(("bedding", f"beds untrue by {way.bedding:g}: {way.draws_text}"))
    if way.limit is not None:
        most = rounded_up(way.limit, UNPROVED)
        rows.append(("limits", f"at most {most} if joints open as they slide (proved); {_LEAST}"))
    told = f"{value}, not decided," if wide else value
    headline = _joined(
        f"load factor {told} {solution.status}: rigid blocks on elastic joints, sliding opens "
        "none; no bound", way.end,
        *(f"{name}: {words}" for name, words in rows if name != "end"),
    )  # fmt: skip
    return Said(
        value=value, standing=standing, headline=headline,
        rows=tuple(rows), report="this with its spread and limits; for a page to sign",
        option=_PAGE,
    )  # fmt: skip


def _limits(bracket: Bracket) -> str:
    """Between which load factors all solutions without dilatancy lie, in words."""
    sides = (
        (bracket.lower, rounded_down, "below", bracket.lower_is_proved),
        (bracket.upper, rounded_up, "above", bracket.upper_is_proved),
    )
    known = [
        (f"{side} {shown(end, UNPROVED)}", "proved" if is_proved else "see the note")
        for end, shown, side, is_proved in sides
        if np.isfinite(end)
    ]
    if len({how for _, how in known}) == 1:
        known = [(" or ".join(where for where, _ in known), known[0][1])]
    return _joined(*(f"none is {where} ({how})" for where, how in known))


def _iterated(solution: Solution) -> Said:
    """Where an iteration without bounds went, or did not."""
    found, status, factor = solution.iteration, str(solution.status), solution.load_factor
    dilates = solution.flow == "associated"
    rows: tuple[tuple[str, str], ...] = () if found is None else (("paper", found.stop),)
    band = "" if found is None else f"{found.band}, with this solver"
    # What answers the question: bounds with bending, or several solutions without dilatancy.
    better, option = "the lowest found of several solutions", _asking(_WITHOUT)
    if dilates:
        surface = "" if solution.surface == "conic" else "--surface conic "
        better, option = "bounds", _asking("certified", surface)
    if (dilates and found is None) or solution.status is Status.SOLVER_FAILED:
        better = option = ""
    if factor is None or not solution.status.is_good:
        headline = _joined(f"no load factor: {status}", band and f"{band}; others end elsewhere")
        return Said(
            value="none", standing=_joined(status, band), headline=headline, rows=rows,
            report=better, option=option,
        )  # fmt: skip
    value, standing = rounded(factor, UNPROVED), f"{status}, which bounds nothing"
    whose = "the iteration" if found is None else "the iteration of the paper"
    headline = _joined(f"where {whose} settled; it bounds nothing", band)
    if not dilates:
        headline = "one solution if sliding opens no joint; there may be lower ones"
    return Said(
        value=value, standing=standing, headline=headline, rows=(*rows, *_sliding(solution)),
        report=better, option=option,
    )  # fmt: skip

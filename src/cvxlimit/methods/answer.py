"""The best answer of a method so far: what a run returns whenever it ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from cvxlimit.base.arrays import FloatArray
from cvxlimit.model.assemblage import Assemblage
from cvxlimit.solution import FromRest, Iteration, LowerEnd, Member, Search
from cvxlimit.solution.bracket import Bracket, Evidence, Reference
from cvxlimit.solution.kinematics import Dilatancy, dilatancy_of


@dataclass(frozen=True, eq=False)
class Answer:
    """The best answer of a method so far.

    Attributes
    ----------
    load_factor : float or None
    bracket : Bracket
        Bounds of the load factor asked for; infinite where the method has none.
    forces : (contacts, 6) array or None
        Those behind the load factor, and behind the lower bound if there is one; columns are V1,
        V2, N, M1, M2, MT (:data:`~cvxlimit.geometry.contacts.COMPONENTS`).
    mechanism : (free blocks, 6) array or None
        That of the upper bound, if there is one: rates along x, y, z and of turning about these.
    members : tuple of Member
        All solutions, where the answer is a set.
    searches : tuple of Search
        What each search for them found.
    iteration : Iteration or None
        How far an iteration without bounds has been.
    internal : (p,) array or None
        The internal forces behind the lower bound, where strength is stated in these.
    reference : Reference or None
        What both bounds were computed with besides.
    beside : mapping of str to Evidence
        As :attr:`Solution.beside <cvxlimit.solution.Solution.beside>`.
    lower_end : LowerEnd or None
        The lower end, where the answer is an interval.
    dilatancy : Dilatancy or None
        Where more is known of it than follows from forces and mechanism.
    sure : Answer or None
        The best one whose lower bound is proved, where this one's is higher and is not.
    from_rest : FromRest or None
        The way to it, where it was reached from rest.
    """

    load_factor: float | None = None
    bracket: Bracket = field(default_factory=Bracket)
    forces: FloatArray | None = None
    mechanism: FloatArray | None = None
    members: tuple[Member, ...] = ()
    searches: tuple[Search, ...] = ()
    iteration: Iteration | None = None
    internal: FloatArray | None = None
    reference: Reference | None = None
    beside: Mapping[str, Evidence] = field(default_factory=dict)
    lower_end: LowerEnd | None = None
    dilatancy: Dilatancy | None = None
    sure: Answer | None = None
    from_rest: FromRest | None = None

    def with_forces(self, of: Callable[[FloatArray], FloatArray]) -> Answer:
        """The answer with ``of`` its contact forces in their place, wherever it has some."""
        forces, end = None if self.forces is None else of(self.forces), self.lower_end
        if end is not None and end.forces is not None:
            end = replace(end, forces=of(end.forces))
        members = tuple(replace(member, forces=of(member.forces)) for member in self.members)
        return replace(self, forces=forces, members=members, lower_end=end)

    def dilatancy_in(self, assemblage: Assemblage) -> Dilatancy | None:
        """Returns the dilatancy in the answer: what the method has found out, or else what follows
        from forces and mechanism. None where these are missing, and under a guide, which moves a
        support."""
        statics, mechanism, alpha = assemblage.statics, self.mechanism, self.load_factor
        if statics.guide is not None:
            return None
        if self.dilatancy is not None:
            return self.dilatancy
        if self.forces is None or mechanism is None or alpha is None:
            return None
        # power of the live load, f_L . u, at the load factor
        power = assemblage.scaling.unit(alpha) * float(statics.live @ mechanism.ravel())
        if not power > 0.0:
            return None
        relative = statics.relative_rates(mechanism)
        return dilatancy_of(assemblage.scene, self.forces, relative, mechanism, power)

    def raised(
        self,
        lower: float,
        is_proved: bool,
        load_factor: float | None,
        forces: FloatArray | None,
        internal: FloatArray | None = None,
        reference: Reference | None = None,
    ) -> Answer:
        """Returns the answer with a better lower bound, and the forces that have it."""
        bracket = self.bracket.raised(lower, is_proved)
        if bracket is not self.bracket:
            kept = self if self.bracket.lower_is_proved else self.sure
            return replace(
                self,
                load_factor=load_factor,
                bracket=bracket,
                forces=forces,
                internal=internal,
                reference=reference,
                sure=None if is_proved else kept,
            )
        if is_proved and not self.bracket.lower_is_proved:
            sure = self.sure or Answer()
            sure = sure.raised(lower, True, load_factor, forces, internal, reference)
            return self if sure is self.sure else replace(self, sure=sure)
        return self

    def lowered(
        self,
        upper: float,
        is_proved: bool,
        mechanism: FloatArray | None,
        reference: Reference | None = None,
    ) -> Answer:
        """Returns the answer with a better upper bound, and the mechanism that has it."""
        bracket = self.bracket.lowered(upper, is_proved)
        if bracket is self.bracket:
            return self
        kept = self.reference
        if reference is not None:
            kept = replace(kept or Reference(), rates=reference.rates)
        return replace(self, bracket=bracket, mechanism=mechanism, reference=kept)

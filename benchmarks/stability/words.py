# ruff: noqa: E501 -- rows of Markdown tables cannot be broken
"""The words of the atlas, between its tables: figures are filled in by :mod:`atlas`."""

HEAD = """
# Where methods fail

A limit analysis asks how far a push on a dry-jointed structure can be scaled up before it falls.
There are many ways to compute that number, and every one of them fails somewhere. This page shows
where: families of small scenes were made to break methods, every method was asked about every scene,
and each answer was judged by something that does not trust the one who gave it.

<!-- record atlas: stamp -->
<!-- /record -->

`.venv/bin/python -m benchmarks.stability` measures everything and writes this page with its pictures
(about half an hour of one core; `--size 5500` is five times as much; what is measured already is not
measured again). `... run --study default` asks our default only, a minute or two; with `--first 2000`
it asks about scenes that nobody has seen.

## In short: which method for which scene

| you have | use | because |
|---|---|---|
| any scene, no interaction with bending | `solve(scene)`, the default | every answer carries a bracket computed outside the solver; none of those below was wrong |
| friction above 1e5 beside friction below 1e-5 | the default, and read its bracket | it may stay open: the status says so and the bounds hold |
| a single solver you call yourself | any, but check its answer: `Certifier` | each of those tried says "optimal" to wrong numbers where weights, sizes or loads lie far apart |
| interaction with bending | `method="certified"` | a bracket; it may be wide, but nothing refuted one |
| to reproduce the paper's iteration | `method="fixed-point"`, old-value weight 0.8 | with independent moments, or with little blending, it wanders, cycles or dies on most walls |
| a value of that iteration that others should find again | signed moments, and two orders of the blocks | their ends lie up to 6 % apart; `FixedPoint(epsilon=1e-2, regularisation=1e-3)` helps on some walls, not on all |
| blocks wedged between supports | the default | a solver left alone returns any of infinitely many states of self-stress |

Answers fall into five classes:

- **right**: within 1e-5 of the certified bracket;
- **no answer, proved**: the dead load cannot stand, or the live load does no harm, and a mechanism or
  forces that show it were found and checked;
- **loose**: off by up to 0.1 %;
- **honest failure**: the method says itself that it has no answer, with a cure;
- **wrong**: called right by the method, and off by more than 0.1 %, or a claim that there is no answer
  where there is one. For our own brackets, anything that contradicts them.

Three failures are told at length, with pictures, among the [notebooks](../notebooks.md): a fixed point
that never settles, blocks that lock each other, and "optimal" that is no proof.

The judge is the certificate, plain NumPy on the full scene, from forces and mechanisms alone;
closed forms for stacks, single blocks, wedges and whatever else follows from equilibrium; and for
every fourth scene a linear program written down a second time, with facets on either side of the
cone. No solver's status is used.

## The scenes
"""

DEFAULT = """
## Our default: {wrong} wrong of {scenes}

{scenes} scenes, {seconds} s of CPU in all: {right} certified to 1e-5, {none} with a proof that there
is no answer, {honest} honest failures, {wrong} wrong. That is {share} with an answer. Of the certified
ones, {proved} rest on no assumption at all on the size of forces or rates.

![Width of the bracket of every scene, by family](atlas-widths.png)
"""

HONEST = """
What is left open, and why. *Frictions of 1e-6 beside 1e6.* The flow
rule asks a joint to open by friction times its slip. A joint with 1e6 that hinges about an edge must
not slip at all, and rounding alone, 1e-16 of the rates, then costs 1e-10 of the loads. Beside a
joint with 1e-6 load factors are 1e-6 to 1e-4; relative to these the rounding error is 1e-6 to 1e-4. Solvers leave 1e-12
in place of 1e-16, and such brackets stay open. The bounds hold; the exit code is 4.

What closes the others. Densities 1e8 apart: a solver's residual of 1e-10 of the total load is a
hundredth of what the lightest block weighs, so the problem is solved once more in units of its own
answer, contact by contact and equation by equation (`CLARABEL rescaled` in the history). Friction of
1e-6 everywhere: contacts that carry nothing are left out of the static bound, as are those around
blocks without weight. Friction of 1e6 everywhere and locked blocks: a mechanism is also certified with
those blocks glued together that it does not move.

"""

METHODS = """
## Believing the solver

{scenes} scenes and all methods: surface (conic, octagon), formulation (corner compressions, contact
resultants, forces at vertices) and solver. *Solver believed* is the paper's problem as one writes it
down (Eq. 9 with Eq. 24 or 25, the user's units), the solver's default settings, and its word taken:
"optimal" with a number, "infeasible" for a dead load that cannot stand, "unbounded" for a live load
that does no harm. *Checked* is this package with that one solver and the certificate behind it.

Of {raw} answers believed, {raw_wrong} were wrong though called right. Of {checked} checked ones,
{checked_wrong}: a solver that misses by more than {right} becomes an honest failure.

![Share of each class, by method](atlas-outcomes.png)

![Where solvers that are believed are wrong](atlas-wrong.png)

How they fail: **boulders**, a pebble on a boulder: residuals are relative to the largest number, and
the pebble is below them. **factors**, load factors of 1e-9 or 1e9: the tolerance is absolute.
**grazing** and **propped**, loads that do next to no harm or none: "optimal" with whatever large
number the iterations had reached. **frictions**, slippery beside gripping joints.
"""

MODELS = """
## Surfaces, readings and flow rules against each other

Not all models have the same answer, so each is judged by its own certificate and by its neighbours:
what inscribed facets allow the cone allows, what that allows circumscribed facets allow; the paper's
line lies inside the parabola and the exact limit of torsion with shear; all readings of Eq. 30 hold
what independent signs hold, and friction at the corners holds what static moments hold; a solution
without dilatancy is a state of the associated problem. So no lower bound of the first may lie above
an upper bound of the second: {pairs} such pairs on {scenes} scenes, {contradicted} contradicted.
Members of zero dilatancy, {members} of them, are checked for equilibrium and yield by a second
writing. Stone so strong that it does not crush, cohesion and tension next to none have to give the
rigid answer back, and the full and the least model that of the default. What is *loose* are brackets
with interaction on a budget of a second, and strong stone; *honest failures* are zero dilatancy and
Gilbert's scheme where there is no load factor, which both call "not converged", or where they do not
settle.
"""

CERTIFIED = """
## With interaction: {refuted} brackets refuted of {brackets}

Bending takes from torsion and shear what Eq. 30 says, and the problem is no longer convex. The
certified method gives a bracket; here it has a budget of a second or two per scene. {scenes} scenes,
independent and signed moments. Three things tried to refute each bracket: closed forms of determinate
scenes, {closed} of them, scanned along their line of forces with Eq. 30 written down a second time;
{states} admissible states found from fixed points and checked by that same second writing; and the
bounds against each other. {five} brackets are within 5 %. {open} have no lower bound on this budget,
which the status says.
"""

FIXED_POINT = """
## The paper's fixed point

It freezes the eccentricities, solves, blends the forces with the old ones and repeats (Eq. 41-43).
Sixty iterations at most. *Converged* was the test of Eq. 43 when this was measured, and is five
small changes in a row now; *cycling* returns to the same values three times over; *wandering* does
neither; *diverged* reached eccentricities at which no load factor exists. A converged value is no bound of anything. Twelve families, {each} scenes of each, five
weights, three readings of the moments: {runs:,} iterations.

![How the iteration ends, by weight of the old forces and family](atlas-fixed-point.png)
"""

ORDERS = """
## The same scene, its blocks in another order

Old-value weight 0.8, {scenes} scenes, blocks in two or three orders, two solvers, {runs} runs. Without
interaction the load factors of a scene differ by at most {plain}. The fixed point's last ones do not
agree like that: optimal contact forces are not unique, which of them a solver returns depends on
rounding, and the next eccentricities are made of them. Two things can be done about it. *Least norm*
(`regularisation=1e-3`): the squared norm of all forces, times 1e-3, is taken off the load factor, so
that there is one best state only. *Epsilon* (`epsilon=1e-2`, the paper's Eq. 41): contacts that carry
next to nothing count as pressed at their centres, where otherwise rounding is divided by rounding.
The table has the spread between the runs of one scene and reading, in shares of the factor without
interaction.
"""

SPREADS = """
On the tuff wall with signed moments the two together make the runs agree, and each alone does not; on
the S12-class panel and on a wall with few loads even both did not, in a larger run. Under the paper's
reading neither helps: it depends on the contacts' axes, which turn with the order of the blocks, so no
choice of forces can make it agree. Nor do unique forces make the iteration a contraction: what solvers
leave of them, 1e-6, is still amplified from one step to the next. So the options are there, and are not
the default.

![Last load factor by order and solver](atlas-orders.png)
"""

PEER = """
## Beside compas_cra

compas_cra (0.8.0, in an environment of its own: `run --study peer --peer PYTHON`) says whether a
structure stands under its own weight. Its rigid-block equilibrium (RBE) has a force with friction at
every vertex, eight facets, and penalises tension: where much is needed, the structure
falls. Our `vertex_forces` is the same model with a round cone. Tilting the structure turns weight into
a push, so RBE should need no tension below our load factor and some above it; the table has the
tension over the weight, at tilts of 0.9 to 1.1 of our load factor. It does the same job where loads are
weights; it has no load factor, no bound, and no interaction.
"""

"""Speed against accuracy on the user's own scene: models in turns, errors against a reference."""

from __future__ import annotations

import gc
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields, replace
from html import escape
from typing import TYPE_CHECKING, Any, TypeAlias

from cvxlimit.base.checks import count
from cvxlimit.base.extras import needed
from cvxlimit.base.progressbar import Progress, progress_bar
from cvxlimit.errors import CvxlimitError, ModelError
from cvxlimit.extensions.studies.chart import draw_time_against_error, on_front
from cvxlimit.extensions.studies.models import Model, Row, reference
from cvxlimit.masonry import single_block
from cvxlimit.scene import Scene, check_scene
from cvxlimit.surfaces import Facets

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

Runner: TypeAlias = "Callable[[Model, Scene], Row]"
"""How one run is made; elsewhere, for those who want it isolated."""

SIDES = ("", "-inscribed")
DEFAULT_MODELS = (
    "cvxlimit", "cvxlimit/1e-8", "cvxlimit/full", "clarabel/1e-4", "clarabel/1e-8",
    *(f"{polygon}{side}" for side in SIDES for polygon in ("octagon", "16-gon", "32-gon")),
)  # fmt: skip
"""What is compared unless asked otherwise: all of it comes with the package's dependencies."""


@dataclass(frozen=True)
class Comparison:
    """Rows of one comparison, in the order of the models.

    Attributes
    ----------
    scene_name : str
    rows : tuple of Row
    is_interrupted : bool
        True after Ctrl-C: the rows are those of the models that had run by then.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> result = compare(builtin_scene("single-block"), ["cvxlimit"], repeat=1, progress=False)
    >>> result.rows[0].method, result.rows[0].error < 1e-5
    ('cvxlimit', True)
    """

    scene_name: str
    rows: tuple[Row, ...] = field(repr=False)
    is_interrupted: bool = False

    @property
    def front(self) -> tuple[str, ...]:
        """Names of the models that no other one beats in both time and error."""
        best = on_front(self.rows)
        return tuple(row.method for row in self.rows if row.method in best)

    def table(self) -> str:
        """Plain text: one line per model, ``*`` for those on the Pareto front; as a table of pandas
        it is :meth:`to_dataframe`."""
        front = self.front
        lines = [["", "model", "load factor", "true error", "seconds", "in solver", "status"]]
        for row in self.rows:
            figures = zip((row.load_factor, row.error, row.total, row.solve),
                          (".7g", ".1e", ".3f", ".3f"), strict=True)  # fmt: skip
            cells = ["" if figure is None else f"{figure:{style}}" for figure, style in figures]
            mark = "*" if row.method in front else ""
            lines.append([mark, row.method, *cells, row.reason or row.status])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        aligned = [
            "  ".join(f"{c:{'>' if 1 < i < 6 else '<'}{widths[i]}}" for i, c in enumerate(line))
            for line in lines
        ]
        notes = ["*: no other model is both faster and nearer"] * bool(front)
        notes += dict.fromkeys(map(_reference_note, self.rows))
        notes += ["interrupted: the models above had run by then"] * self.is_interrupted
        return "\n".join([*map(str.rstrip, aligned), *notes])

    def to_dataframe(self) -> DataFrame:
        """All columns of :class:`Row` with the model as index, and whether it is on the front.

        Raises
        ------
        ModelError
            If pandas is not installed.
        """
        pandas = needed("pandas", "frames", "tables")
        names = [column.name for column in fields(Row)]
        table = pandas.DataFrame([asdict(row) for row in self.rows], columns=names)
        table["is_on_front"] = table["method"].isin(self.front)
        result: DataFrame = table.set_index("method")
        result.attrs = {"scene": self.scene_name, "is_interrupted": self.is_interrupted}
        return result

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.table())}</pre>"

    def plot(self, ax: Axes | None = None, **options: Any) -> Figure:
        """Time against true error with the Pareto front, into ``ax`` or a figure of its own.

        ``figsize``, ``title`` and ``legend`` are those of :func:`cvxlimit.plotting.picture`.

        Raises
        ------
        ModelError
            If Matplotlib is not installed, or no model has both a time and an error.
        """
        left_out = sum(not row.has_point for row in self.rows)
        if left_out == len(self.rows):
            raise ModelError("there is nothing to draw: no model has a time and a true error")
        from cvxlimit.plotting.registry import figures

        chart = figures("sheet").Sheet.of((10.0, 5.2), ax=ax, **options)
        draw_time_against_error(chart.axes, self.rows)
        note = f"; {left_out} of {len(self.rows)} models have no figure" if left_out else ""
        chart.write(f"{self.scene_name}: time against true error{note}")
        figure: Figure = chart.figure
        return figure


def compare(
    scene: Scene,
    models: str | Model | Sequence[str | Model] | None = None,
    *,
    facets: Sequence[int] | None = None,
    repeat: int = 3,
    progress: Progress = True,
) -> Comparison:
    """Time and true error of several models on one scene.

    Models take turns in this process, and of several runs the one of the median time counts.
    Errors are relative to a reference proved to 1e-9 where that can be had
    (``found.table()`` says), never to a model's own claim; with interaction to the
    certified bracket.

    Parameters
    ----------
    scene : Scene
    models : (sequence of) str or Model, or None
        Names whose parts are options of :func:`cvxlimit.solve`, as ``"16-gon"``,
        ``"octagon/clarabel/1e-4"``, ``"certified/paper"``; ``"cvxlimit"`` is the default; or
        your own :class:`Model`, with surfaces of your own if you like. None is
        :data:`DEFAULT_MODELS`, or none besides ``facets``.
    facets : sequence of int or None
        Numbers of facets in place of the cone, each outside and inside it, beside the cone itself.
    repeat : int
        Runs per model.
    progress : bool, callable or None
        Show a bar on stderr, or call this with a line of text after every run.

    Returns
    -------
    Comparison
        Models that fail are rows with a reason. On Ctrl-C, the rows measured by then. Its
        ``to_dataframe()`` is the table.

    Raises
    ------
    ModelError
        For an unknown name, two models of one name, no model, or a repeat below 1.
    InputError
        If ``scene`` is no scene, or its geometry is not valid.
    KeyboardInterrupt
        On Ctrl-C before anything was measured.

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> from cvxlimit.solvers import settings_for
    >>> loose = Model("loose", surface="octagon", solver=settings_for("CLARABEL", 1e-3))
    >>> result = compare(builtin_scene("single-block"), [loose], repeat=1, progress=False)
    >>> result.rows[0].failed
    False
    """
    count(repeat, 1, "repeat")
    check_scene(scene)
    given = (DEFAULT_MODELS if facets is None else ()) if models is None else models
    is_one = isinstance(given, str) or not isinstance(given, Sequence)
    several: Any = [given] if is_one else given
    polygons = [] if facets is None else [f"{Facets.circumscribed(k)}" for k in facets]
    beside = ["conic"] * bool(polygons) + [f"{k}{side}" for side in SIDES for k in polygons]
    chosen = _checked([*beside, *several])
    len(scene.contacts)  # faults of the geometry show here, once
    steps = len({model.moments for model in chosen}) + repeat * len(chosen)
    with progress_bar("comparing", steps, progress) as advance:
        return side_by_side(chosen, scene, repeat, advance)


def _checked(models: Sequence[str | Model]) -> list[Model]:
    result: dict[str, Model] = {}
    for given in models:
        model = Model.named(given) if isinstance(given, str) else given
        if not isinstance(model, Model):
            raise ModelError(f"models must be names or Model objects, got {given!r}")
        if model.name in result and not isinstance(given, str):
            raise ModelError(f"two models are called {model.name!r}: rename one")
        result[model.name] = model
    if not result:
        raise ModelError("there is nothing to compare: give at least one model")
    return list(result.values())


def side_by_side(
    models: Sequence[Model],
    scene: Scene,
    repeat: int,
    advance: Callable[[str], None] = lambda done: None,
    run: Runner | None = None,
    refer: Runner | None = None,
) -> Comparison:
    """Measure all models on one scene in turns, so that a busy machine hits them alike.

    A model that fails is not run again. ``advance`` is told after every run; ``run`` and ``refer``
    run models and references elsewhere. Ctrl-C ends it with the rows measured by then, if any.
    """
    measure, truths = run or run_here, dict[str, Row]()
    for moments in dict.fromkeys(model.moments for model in models):
        truths[moments] = (refer or measure)(reference(moments), scene)
        advance("reference")
    results: dict[str, list[Row]] = {model.name: [] for model in models}
    is_interrupted = False
    try:
        for turn in range(repeat):
            for model in models:
                if run is None and turn == 0:
                    with suppress(Exception):  # what is imported and compiled once is not timed
                        model.measure(single_block())
                if not any(result.failed for result in results[model.name]):
                    results[model.name].append(measure(model, scene))
                advance(model.name)
    except KeyboardInterrupt:
        if not any(results.values()):
            raise
        is_interrupted = True
    done = [(model, results[model.name]) for model in models if results[model.name]]
    rows = (row_of(model, scene, found, truths[model.moments]) for model, found in done)
    return Comparison(scene.name, tuple(rows), is_interrupted)


def run_here(model: Model, scene: Scene) -> Row:
    """One run of a model on a copy of the scene; whatever it raises is a failure's reason.

    What earlier runs left is collected before: a full collection takes Python 30 ms and would fall
    into whichever phase comes first.
    """
    gc.collect()
    try:
        found = model.measure(replace(scene))
    except CvxlimitError as error:
        return Row(reason=str(error))
    except Exception as error:
        return Row(reason=f"{type(error).__name__}: {' '.join(str(error).split())[:160]}")
    is_known = found.load_factor is not None
    return found if is_known else Row(reason=f"no load factor: {found.status}")


def row_of(model: Model, scene: Scene, runs: Sequence[Row], truth: Row) -> Row:
    """The run of the median time, or the failure with its reason, beside the reference's run."""
    done = sorted((run for run in runs if not run.failed), key=lambda run: run.total or 0.0)
    failed = next((run for run in runs if run.failed), None)
    row = replace(
        failed or done[len(done) // 2], scene=scene.name, contacts=len(scene.contacts),
        method=model.name, line=model.line, runs=len(done), **model.axes(),
        reference_lower=truth.lower, reference_upper=truth.upper,
        reference=f"no reference: {truth.reason}" if truth.failed else truth.status,
    )  # fmt: skip
    return replace(row, error=row.truth.error(row.load_factor))


def _reference_note(row: Row) -> str:
    kind = f" with {row.moments} moments" if row.moments else ""
    if row.reference_lower is None or row.reference_upper is None:
        return f"reference{kind}: {row.reference}"
    return (
        f"reference{kind}: [{row.reference_lower:.10g}, {row.reference_upper:.10g}], "
        f"{row.reference}"
    )

"""Speed against accuracy on the user's own scene: methods in turns, errors against a reference."""

from __future__ import annotations

import csv
import gc
import io
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from html import escape
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any, TypeAlias

from cvxlimit.base.checks import count
from cvxlimit.base.extras import needed
from cvxlimit.base.files import write_file
from cvxlimit.base.progressbar import progress_bar
from cvxlimit.errors import CvxlimitError, ModelError
from cvxlimit.extensions.compare.chart import draw_against_facets, draw_time_against_error, on_front
from cvxlimit.extensions.compare.models import PHASES, Method, Reference, Row
from cvxlimit.extensions.compare.registry import choose, of_facets, registry
from cvxlimit.masonry import single_block
from cvxlimit.scene import Scene, check_scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame

Runner: TypeAlias = "Callable[[Method, Scene], Row]"
"""How one run is made; elsewhere, for those who want it isolated."""

DEFAULT_MODELS = (
    "cvxlimit",
    "cvxlimit/1e-8",
    "conic/corners/clarabel-qdldl/*",
    "conic/corners/clarabel-faer/*",
    "conic/resultants/*",
    "octagon*/corners/clarabel-qdldl/*",
    "??-gon*/corners/clarabel-qdldl/*",
    "octagon/corners/highs-ipm/*",
)
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
    rows: tuple[Row, ...]
    is_interrupted: bool = False

    @property
    def front(self) -> tuple[str, ...]:
        """Names of the models that no other one beats in both time and error."""
        best = on_front(self.rows)
        return tuple(row.method for row in self.rows if row.method in best)

    def table(self) -> str:
        """Plain text: one line per model, ``*`` for those on the Pareto front."""
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

    def __repr__(self) -> str:
        return f"Comparison({self.scene_name!r}: {', '.join(row.method for row in self.rows):.100})"

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

    def plot_facets(self, figsize: tuple[float, float] = (10.0, 4.0)) -> Figure:
        """Error and time against the number of facets, outside and inside the cone.

        Raises
        ------
        ModelError
            If Matplotlib is not installed, or no model with facets has a time and an error.
        """
        rows = [row for row in self.rows if row.has_point and row.interaction == "none"]
        if not any(row.facets for row in rows):
            raise ModelError("no model has facets: ask for some by compare(scene, facets=[4, 8])")
        from cvxlimit.plotting.registry import figures

        figure: Figure = figures("sheet").SceneFigure(figsize=figsize, layout="constrained")
        draw_against_facets(figure.subplots(1, 2), rows)
        figure.suptitle(f"{self.scene_name}: facets in place of the cone", parse_math=False)
        return figure

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns of all rows; returns the file's path.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, [column.name for column in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in self.rows)
        write_file(path, text.getvalue().encode("utf-8"))
        return Path(path)


def compare(
    scene: Scene,
    models: str | Method | Sequence[str | Method] | None = None,
    *,
    facets: Sequence[int] | None = None,
    repeat: int = 3,
    progress: bool | Callable[[str], None] = True,
) -> Comparison:
    """Time and true error of several models on one scene.

    Models take turns in this process, and figures are medians. Errors are
    relative to a reference certified to 1e-8 where that can be had (``row.reference`` says),
    never to a model's own claim; with interaction to the certified bracket.

    Parameters
    ----------
    scene : Scene
    models : (sequence of) str or Model, or None
        Names from :func:`cvxlimit.extensions.compare.registry.registry`, with ``*`` and ``?``,
        surfaces as sweeps take them (``"16-gon"``), or your own
        :class:`~cvxlimit.extensions.compare.models.Model`, with surfaces of your own if you like.
        None is :data:`DEFAULT_MODELS`, or none besides ``facets``.
    facets : sequence of int or None
        Numbers of facets in place of the cone, each outside and inside it, beside the cone itself:
        :meth:`Comparison.plot_facets` draws error and time against them.
    repeat : int
        Runs per model.
    progress : bool or callable
        Show a bar on stderr, or call this with a line of text after every run.

    Returns
    -------
    Comparison
        Models that fail are rows with a reason. On Ctrl-C, the rows measured by then.

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
    >>> from cvxlimit.compare import Model, settings_for
    >>> loose = Model("loose", surface="octagon", solver=settings_for("CLARABEL", 1e-3))
    >>> result = compare(builtin_scene("single-block"), [loose], repeat=1, progress=False)
    >>> result.rows[0].failed
    False
    """
    count(repeat, 1, "repeat")
    check_scene(scene)
    polygons = [] if facets is None else of_facets(facets)
    given = (DEFAULT_MODELS if facets is None else ()) if models is None else models
    is_one = isinstance(given, str) or not isinstance(given, Sequence)
    several: Any = [given] if is_one else given
    methods = _methods([*polygons, *several])
    len(scene.contacts)  # faults of the geometry show here, once
    steps = len({question_of(method) for method in methods}) + repeat * len(methods)
    with progress_bar("comparing", steps, progress) as advance:
        try:
            return Comparison(scene.name, tuple(side_by_side(methods, scene, repeat, advance)))
        except Interrupted as interrupt:
            if not interrupt.args[0]:
                raise
            return Comparison(scene.name, interrupt.args[0], is_interrupted=True)


def _methods(models: Sequence[str | Method]) -> list[Method]:
    known = [*registry().values()]
    result: dict[str, Method] = {}
    for model in models:
        for method in choose([model], known) if isinstance(model, str) else [model]:
            if not isinstance(method, Method):
                raise ModelError(f"models must be names or Model objects, got {method!r}")
            if result.setdefault(method.name, method) != method:
                raise ModelError(f"two models are called {method.name!r}: rename one")
    if not result:
        raise ModelError("there is nothing to compare: give at least one model")
    return list(result.values())


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while methods were measured; its argument is a tuple of the rows of those that ran.

    Their medians are over fewer runs than asked for where the last turn was not finished.
    """


def side_by_side(
    methods: Sequence[Method],
    scene: Scene,
    repeat: int,
    advance: Callable[[str], None] = lambda done: None,
    run: Runner | None = None,
    refer: Runner | None = None,
) -> list[Row]:
    """Measure all methods on one scene in turns, so that a busy machine hits them alike.

    A method that fails is not run again. ``advance`` is told after every run; ``run`` and ``refer``
    run methods and references elsewhere. Ctrl-C raises :class:`Interrupted`.
    """
    measure, truths = run or run_here, dict[Reference, Row]()
    for reference in dict.fromkeys(map(question_of, methods)):
        truths[reference] = (refer or measure)(reference, scene)
        advance("reference")
    results: list[list[Row]] = [[] for _ in methods]

    def rows() -> list[Row]:
        pairs = zip(methods, results, strict=True)
        return [row_of(m, scene, found, truths[question_of(m)]) for m, found in pairs if found]

    try:
        for turn in range(repeat):
            for method, found in zip(methods, results, strict=True):
                if run is None and turn == 0:
                    with suppress(Exception):  # what is imported and compiled once is not timed
                        method.measure(single_block())
                if not any(result.failed for result in found):
                    found.append(measure(method, scene))
                advance(method.name)
    except KeyboardInterrupt as error:
        raise Interrupted(tuple(rows())) from error
    return rows()


def question_of(method: Method) -> Reference:
    """What the method's errors are measured against."""
    return Reference(interaction=method.interaction, moments=method.moments)


def run_here(method: Method, scene: Scene) -> Row:
    """One run of a method on a copy of the scene; whatever it raises is a failure's reason.

    What earlier runs left is collected before: a full collection takes Python 30 ms and would fall
    into whichever phase comes first.
    """
    gc.collect()
    try:
        found = method.measure(replace(scene))
    except MemoryError:
        return Row(reason="out of memory")
    except CvxlimitError as error:
        return Row(reason=str(error))
    except Exception as error:
        return Row(reason=f"{type(error).__name__}: {' '.join(str(error).split())[:160]}")
    is_known = found.load_factor is not None
    return found if is_known else Row(reason=f"no load factor: {found.status}")


def row_of(method: Method, scene: Scene, runs: Sequence[Row], truth: Row) -> Row:
    """Medians of the runs, or the failure with its reason, beside the reference's run."""
    done = sorted((run for run in runs if not run.failed), key=lambda run: run.total or 0.0)
    row = next((run for run in runs if run.failed), None)
    if row is None:
        names = (*PHASES, "total", "memory")
        times: dict[str, Any] = {n: _median(getattr(run, n) for run in done) for n in names}
        row = done[len(done) // 2]
        row = replace(row, **times, total_min=done[0].total, total_max=done[-1].total)
    axes: dict[str, Any] = dict(method.axes())
    row = replace(
        row, scene=scene.name, blocks=len(scene.free), contacts=len(scene.contacts),
        method=method.name, line=method.line, **axes, runs=len(done),
        reference_lower=truth.lower, reference_upper=truth.upper,
        reference=f"no reference: {truth.reason}" if truth.failed else truth.status,
    )  # fmt: skip
    return replace(row, error=row.truth.error(row.load_factor))


def _median(values: Iterable[float | None]) -> float | None:
    figures = [value for value in values if value is not None]
    return median(figures) if figures else None


def _reference_note(row: Row) -> str:
    kind = "" if row.interaction == "none" else f" with {row.moments} moments"
    if row.reference_lower is None or row.reference_upper is None:
        return f"reference{kind}: {row.reference}"
    return (
        f"reference{kind}: [{row.reference_lower:.10g}, {row.reference_upper:.10g}], "
        f"{row.reference}"
    )

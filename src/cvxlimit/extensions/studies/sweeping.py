"""Sweeps: all variations of a structure in one call, here or on a cluster, stored as they come."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from cvxlimit.base.extras import needed
from cvxlimit.base.progressbar import Progress, progress_bar
from cvxlimit.base.search import searched
from cvxlimit.base.versions import __version__
from cvxlimit.errors import InputError
from cvxlimit.extensions.studies.patched import nearest_first
from cvxlimit.extensions.studies.rows import OF_A_WAY, RESULTS, Row, Study
from cvxlimit.extensions.studies.store import IDENTITY, KEY, PROOF, Store, key_of
from cvxlimit.extensions.studies.variations import Grid, variations_of
from cvxlimit.io.scenes import scene_digest, scene_to_dict
from cvxlimit.scene import Scene
from cvxlimit.solution import Solution

if TYPE_CHECKING:
    from pandas import DataFrame


def sweep(
    scenes: Callable[..., Scene] | Scene,
    grid: Grid,
    *,
    executor: Any = None,
    path: str | os.PathLike[str] | None = None,
    measure: Callable[[Solution], Mapping[str, Any]] | None = None,
    progress: Progress = True,
    **options: Any,
) -> DataFrame:
    """Solve all variations of a structure, and return a table with one row for each.

    Scenes of the same geometry share their contacts, equilibrium and its factorisation; by the
    convex method they are one :class:`~cvxlimit.LimitProblem`, whose strengths and loads are
    Parameters: the solver starts from the row before, and random draws are solved in an order in
    which the next one is near. Every row has a bracket of its own, recomputed outside the solver,
    within which its last digits depend on the rows before; a variation that cannot be built or
    solved is a row that says why.

    Parameters
    ----------
    scenes : callable or Scene
        A function from parameters to a scene; or a scene, which is then varied by the parameters
        of :func:`~cvxlimit.studies.varied`: friction, density, size, tilt, direction ...
    grid : mapping, sequence of mappings, or DataFrame
        Values by parameter, of which all combinations are solved; or one variation per row, as
        :func:`~cvxlimit.studies.draws` makes them at random. Options of :func:`cvxlimit.solve`
        may be among them: ``"surface": ["conic", "octagon"]``.
    executor : concurrent.futures.Executor, dask.distributed.Client, or None
        Where rows are solved: this process (None), other processes (``ProcessPoolExecutor()``), or
        a cluster. The tasks of a cluster's dead worker are done by another.
    path : path or None
        A folder in which rows are stored as Parquet files as soon as they are solved. The same call
        continues an interrupted sweep: stored rows are not solved again.
    measure : callable or None
        From a solution to further columns: ``lambda s: {"moving": len(s.mechanism)}``.
    progress : bool, callable or None
        Show a bar on stderr, or call this with a line of text after every row.
    options
        Of :func:`cvxlimit.solve`, for all variations.

    Returns
    -------
    DataFrame
        In the order of the grid: the parameters; ``load_factor``, ``lower``, ``upper``, ``gap``,
        ``least_factor`` of an interval, the share of ``dilatancy``; ``status``, ``note`` (the
        answer in a sentence), ``solver``; ``error``, empty where all went well; ``seconds``. By
        method ``"incremental"`` the load factor is that reached from rest, and there are
        ``from_rest_to_come`` and ``from_rest_limit`` (:class:`~cvxlimit.solution.FromRest`), and
        the least and the largest of the other ends: ``from_rest_spread_least``,
        ``from_rest_spread_most``, ``from_rest_beds_least``, ``from_rest_beds_most``.
        ``table.attrs["found"]`` counts the rows that were stored already. After Ctrl-C those rows
        that were done, and ``table.attrs["is_interrupted"]``.

    Raises
    ------
    InputError
        For parameters that the factory does not have, and a folder that holds another sweep.
    ModelError
        For options that :func:`cvxlimit.solve` does not have, if pandas is not installed, or if
        a process dies (which a cluster survives).

    Example
    -------
    >>> from cvxlimit import builtin_scene
    >>> table = sweep(builtin_scene("stack"), {"tilt": [0, 5, 10]}, progress=False)
    >>> table["load_factor"].round(3).tolist()
    [0.4, 0.311, 0.22]
    """
    study, table = Study(scenes, options, measure), variations_of(grid)
    _check_names(table)
    records: list[Row] = table.to_dict("records")
    study.check(records)
    names = [str(i) if path is None else key_of(row) for i, row in enumerate(records)]
    store, about = None, _about(study)
    if path is not None:
        study = study.to_be_stored()  # nothing is refused once the folder is there
        store = Store(path, {**about, "base": _base(scenes)})
        study = replace(study, stored=frozenset(store.rows))
    variations = dict(zip(names, records, strict=True))
    done, is_interrupted = _done(study, variations, executor, store, progress)
    result = _joined(table, [done.get(name) for name in names])
    result.attrs = {
        **about,
        "version": __version__,
        "variations": len(variations),
        "found": sum(row.get(IDENTITY) in study.stored for row in done.values()),
        "is_interrupted": is_interrupted,
    }
    return result


def _check_names(table: DataFrame) -> None:
    """Raises InputError for a parameter that is called like a result."""
    clash = sorted(set(table.columns) & {*RESULTS, *OF_A_WAY, KEY, IDENTITY, PROOF})
    if clash:
        cure = "; its name as a parameter is ladder" if clash[0] == "solver" else ""
        raise InputError(
            f"a parameter must not be called {clash[0]!r}: a result is called so{cure}"
        )


def _done(
    study: Study,
    variations: Mapping[str, Row],
    executor: Any,
    store: Store | None,
    progress: Progress,
) -> tuple[dict[str, Row], bool]:
    """Returns the rows by name, and whether Ctrl-C came before all were there."""
    done = dict[str, Row]()
    with progress_bar("sweep", len(variations), progress) as advance:
        try:
            for name, row in _solved(study, variations, executor):
                done[name] = row if store is None else store.add(name, variations[name], row)
                advance(done[name]["error"] or f"{done[name]['load_factor']:.6g}")
        except KeyboardInterrupt:
            return done, True
        finally:
            if store is not None:
                store.flush()
    return done, False


def _solved(
    study: Study, variations: Mapping[str, Row], executor: Any
) -> Iterator[tuple[str, Row]]:
    """Yields rows with their names, as they come. To other processes they go in groups of up to 20:
    a task costs 1 ms in a process pool, some 5 ms on a cluster."""
    todo = [(name, variations[name]) for name in nearest_first(variations)]
    size = 1 if executor is None else min(max(1, len(todo) // 100), 20)
    groups = iter([todo[i : i + size] for i in range(0, len(todo), size)])
    for group, rows in searched(study, partial(next, groups, None), executor):
        yield from zip((name for name, _ in group), rows, strict=True)


def _joined(table: DataFrame, rows: Sequence[Row | None]) -> DataFrame:
    """Returns the variations that have a row, with its results, and with what was measured. Stored
    rows have NaN in columns that only others of the folder measured."""
    pandas = needed("pandas", "frames", "sweeps")
    done = {i: row for i, row in enumerate(rows) if row is not None}
    known, measured = {*RESULTS, *table.columns, KEY, IDENTITY, PROOF}, dict[str, None]()
    for row in done.values():
        is_new = KEY not in row
        measured |= {name: None for name, x in row.items() if is_new or (x is not None and x == x)}
    columns = [*RESULTS, *(name for name in measured if name not in known)]
    found = pandas.DataFrame(list(done.values()), columns=columns)
    result: DataFrame = pandas.concat(
        [table.iloc[list(done)].reset_index(drop=True), found], axis=1
    )
    return result


def _about(study: Study) -> dict[str, str]:
    """Returns a description of a sweep's scene and options; another one may not share its folder.

    Objects are told by their classes, functions by their names: an edited one goes on in the same
    folder, where its rows are told from earlier ones by their identities.
    """
    given = study.scenes
    scene = f"{given.name} {scene_digest(given)}" if isinstance(given, Scene) else _in_words(given)
    options = ", ".join(
        f"{name}={_in_words(value)}" for name, value in sorted(study.options.items())
    )
    return {"scene": scene, "options": options}


def _in_words(value: Any) -> str:
    """Returns a text for an option's value, or the qualified name of its class or function."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return repr(value)
    if isinstance(value, partial):
        return _in_words(value.func)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_in_words, value))}]"
    named = value if hasattr(value, "__qualname__") else type(value)
    return f"{named.__module__}.{named.__qualname__}"


def _base(scenes: Any) -> dict[str, Any] | None:
    """Returns the varied scene as a document, with which rows can be proved again; None for a
    function."""
    return scene_to_dict(scenes) if isinstance(scenes, Scene) else None

"""What is measured, and how: ``python -m benchmarks list``.

An experiment is a generator of tables in ``experiments/`` (:mod:`benchmarks.experiment`), a scene
has a name (:mod:`benchmarks.scenes`), runs have processes of their own (:mod:`benchmarks.runs`),
rows that are kept are lines of JSON (:mod:`benchmarks.rows`), and what was printed goes into the
pages of the documentation (:mod:`benchmarks.evidence`). ``stability/`` makes scenes that break
methods and judges answers, ``bench/`` is the open bench of published values.
"""

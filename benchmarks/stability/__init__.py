"""Where methods fail: scenes made to break them, and what each method says about them.

``python -m benchmarks.stability run`` fills ``benchmarks/results/stability``; ``write`` makes
``docs/evidence/atlas.md`` and its pictures from it.
"""

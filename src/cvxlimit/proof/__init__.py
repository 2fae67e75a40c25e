"""Bounds recomputed outside the solver, and the reference states that prove them."""

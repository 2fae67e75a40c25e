"""Ways from a scene to a solution: one convex problem, or an outer loop around many."""

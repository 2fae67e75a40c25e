"""Bounds from above: convex hulls of all that contacts can carry."""

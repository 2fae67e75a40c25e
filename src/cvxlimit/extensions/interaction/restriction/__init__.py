"""Bounds from below: admissible forces, step by step, each checked outside the solver."""

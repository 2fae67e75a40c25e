"""Friction that slides without opening: solutions, bounds, what associated answers owe to it."""

"""Friction that slides without opening: solutions, bounds, and what associated answers owe to it."""

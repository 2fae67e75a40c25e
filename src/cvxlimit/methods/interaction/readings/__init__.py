"""Readings of Eq. 30: how moments add up, and all that depends on it."""

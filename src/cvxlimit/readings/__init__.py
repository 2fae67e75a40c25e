"""Readings of Eq. 30: how moments add up, and all that depends on it.

A further reading is one more class in ``moments`` or ``named``.
"""

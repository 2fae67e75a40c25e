"""Torsion-shear-bending interaction (Eq. 26-32), each folder seeing those before it.

What one contact carries, and how Eq. 30 is read, is in :mod:`cvxlimit.readings`.

- ``relaxation``, ``restriction``, ``branching``: bounds from above, from below, and both closed.
"""

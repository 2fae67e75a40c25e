"""Torsion-shear-bending interaction (Eq. 26-32): a rule for the next convex problem, and a driver.

``pressure`` is the physics and the independent checker, ``fixed_point`` the paper's iteration,
``inner`` the safe steps from below, ``outer`` the relaxations from above, ``certified`` the
bracket made of both.
"""

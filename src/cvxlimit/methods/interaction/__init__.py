"""Torsion-shear-bending interaction (Eq. 26-32): what the fixed point and the bracket stand on.

Folders, lowest first; each sees those before it:

- ``states``: one contact. The independent checker of Eq. 30 (``pressure``), its true states from
  outside (``support``, ``copies``, ``cells``) and from inside (``majorants``, ``rectangles``);
- ``readings``: what depends on how Eq. 30 adds moments; a further reading is one more class here;
- ``relaxation``: bounds from above, the convex hull of every contact's states;
- ``restriction``: bounds from below, and loads that need none (``slater``);
- ``branching``: both, closed by branch and bound.
"""

"""Torsion-shear-bending interaction (Eq. 26-32): what the fixed point and the bracket stand on.

- ``pressure``: the physics, and the independent checker of Eq. 30;
- ``safe_step``, ``inner``, ``rectangles``, ``lower_bound``: bounds from below;
- ``support``, ``copies``, ``hull``: bounds from above;
- ``moments``, ``readings``, ``tied``: what depends on how Eq. 30 is read;
- ``recognition``: live loads that do no harm, dead loads that stand;
- ``branching``: both, closed by branch and bound on small scenes.
"""

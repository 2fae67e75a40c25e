"""Torsion-shear-bending interaction (Eq. 26-32), each folder seeing those before it.

- ``states``: one contact, from outside (``support``, ``copies``, ``cells``) and from inside;
- ``readings``: what depends on how Eq. 30 adds moments; a further reading is one more class here;
- ``relaxation``, ``restriction``, ``branching``: bounds from above, from below, and both closed.
"""

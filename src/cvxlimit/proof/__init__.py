"""Bounds recomputed outside the solver, and the reference states that prove them.

To read: ``strength.py``, what contacts bear; ``conditions.py``, as rows on its forces; ``flow.py``,
which rates these allow; ``certificate.py``, both bounds by weak duality; ``references.py``, the
reference states; ``opening.py``, mechanisms; ``gluing.py``, smaller assemblages; ``tresca.py``,
friction held; ``admissible.py``, forces that carry a load exactly; ``minorant.py``, bounds on
forces; ``checks.py``, a claim and whether it holds.
"""

"""For all tests: no property is judged by the clock, so that a busy machine fails none of them.

BLAS has one thread unless the environment says otherwise: the problems of the tests are small, and
threads that wait for one another would take half of the processor's time.
"""

import os

from hypothesis import HealthCheck, settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

settings.register_profile("no clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("no clock")

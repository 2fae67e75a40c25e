"""Motion in time under a ground acceleration, by MuJoCo (extra ``dynamics``)."""

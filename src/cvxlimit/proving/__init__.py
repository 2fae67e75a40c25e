"""Results, domains, paths and sweeps, proved again."""

"""The mechanical model: equilibrium, its scaling, force variables, the convex problems."""

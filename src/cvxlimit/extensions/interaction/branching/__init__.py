"""Branch and bound over eccentricities."""

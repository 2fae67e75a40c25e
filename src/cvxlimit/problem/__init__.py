"""LimitProblem, as users state and solve it: limits, Parameters and aims of their own."""

"""What is read off a solution: sensitivity, utilisation, uniqueness, tables."""

"""A solver of this package for cones that fall apart into small blocks."""

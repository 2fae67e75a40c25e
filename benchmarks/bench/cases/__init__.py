"""Scripts that make the cases, by kind of structure."""

"""Interaction measured: the paper's iteration under every reading, beside certified brackets."""

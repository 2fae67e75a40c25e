"""The command line: :mod:`main` parses and runs, :mod:`report` shows."""

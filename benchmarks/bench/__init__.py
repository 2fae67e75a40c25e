"""The open bench: structures with published values, each with a proved bracket beside it."""

"""After the collapse load factor: the path of a structure in finite displacements."""

"""One picture of a solution in each module; a module that is put here is found."""

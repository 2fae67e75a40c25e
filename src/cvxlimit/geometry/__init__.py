"""Shapes: blocks, the polygons they touch in, and how contacts are found."""

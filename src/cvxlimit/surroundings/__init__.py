"""What surrounds a structure: water, soil and wheels as loads on the faces that they reach, and
soil that resists."""

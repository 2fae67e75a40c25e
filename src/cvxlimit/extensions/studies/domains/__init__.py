"""Load domains: all load vectors that a structure carries, enclosed with proof."""

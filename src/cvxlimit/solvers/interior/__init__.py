"""An interior-point method that eliminates contacts and factorises what is left of the blocks."""

"""Vehicles that cross a bridge: the load factor at every position."""

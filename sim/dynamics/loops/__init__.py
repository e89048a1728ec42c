"""Closed loops and gears: their constraints, the system that couples branches, motion through singular poses."""

"""Motions: loops over time with and without gains and derivatives, and steps of order 4 to 8."""

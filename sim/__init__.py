"""Rigid-body simulation with contact: mechanisms, time steps and their derivatives. Imports `solvers` only."""

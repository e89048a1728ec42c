"""Quantities in task space along a trajectory, with exact derivatives: frames, momenta, contacts, distances, forces."""

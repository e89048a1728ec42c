"""Costs and constraints in task space: frames, centre of mass, momentum, contacts and their forces, distances."""

"""Numerics that know nothing of robots: dense algebra, cones, the backward pass, box QP. Imports nothing of ours."""

"""Numerics without robots: dense algebra, cones, the backward pass, box QP. Imports none of the other packages."""

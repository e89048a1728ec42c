"""Meshes of robot files: their paths, triangles and colours, and convex shapes in their place."""

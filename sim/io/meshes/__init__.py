"""Meshes of files: where they are, their triangles and colours, and the convex shapes that stand for them."""

"""Contact geometry of two shapes: distance, normal, point and their derivatives, without mechanisms or steps."""

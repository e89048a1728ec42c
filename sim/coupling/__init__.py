"""What couples branches of the tree: closed loops, gears, and the dense system they share with pairs."""

"""Motion of the tree: kinematics, momentum balance, elimination, energy, coordinates."""

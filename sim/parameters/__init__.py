"""Parameters of a mechanism: their names, their values, and the derivatives of a step by them."""

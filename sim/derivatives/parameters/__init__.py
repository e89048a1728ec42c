"""Parameters of a mechanism: names, values, and the derivatives of a step by them."""

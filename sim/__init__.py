"""One mechanism, one time step, and the derivatives of that step. Imports `solvers` only."""

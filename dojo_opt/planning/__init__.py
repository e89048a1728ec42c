"""Planning: a problem as arrays, and iLQR, which solves it."""

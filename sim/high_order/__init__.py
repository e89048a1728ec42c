"""Steps of order 4, 6 and 8: Runge-Kutta methods for Hamilton's equations of a tree."""

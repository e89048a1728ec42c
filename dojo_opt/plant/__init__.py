"""Plants: simulators that differ from a controller's model, closed loops with them, and Monte Carlo runs."""

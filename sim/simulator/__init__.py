"""Simulator: settings, checks of arguments, results, and the compiled calls behind each method."""

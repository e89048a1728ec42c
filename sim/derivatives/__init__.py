"""Derivatives of a solved step by state and input, through the implicit function theorem."""

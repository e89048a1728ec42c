"""Friction against spinning and rolling: moments of a contact, bounded by its normal impulse."""

"""Contacts between two bodies, or of a body with an obstacle, as part of a step."""

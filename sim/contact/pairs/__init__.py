"""Contact between two bodies, or a body and an obstacle, as part of a step."""

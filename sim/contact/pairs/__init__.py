"""Contact between two bodies, or between a body and an obstacle, as part of a step."""

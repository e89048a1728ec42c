"""The solution of a step: Newton's method, and the interior point for scenes with contacts or limits."""

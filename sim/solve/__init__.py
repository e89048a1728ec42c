"""The solution of a step: Newton's method, and the interior point where there are contacts or limits."""

"""Whether a call has succeeded, and whether it tries again."""

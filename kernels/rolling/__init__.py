"""Models of the role rolling."""

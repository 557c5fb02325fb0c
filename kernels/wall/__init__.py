"""Models of the role wall."""

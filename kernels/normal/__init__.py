"""Models of the role normal."""

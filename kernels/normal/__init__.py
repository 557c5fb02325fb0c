"""Models of the role normal."""

DEFAULT = "hertz"

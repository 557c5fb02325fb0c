"""Models of the role tangential."""

DEFAULT = "mindlin"

"""Models of the role tangential."""

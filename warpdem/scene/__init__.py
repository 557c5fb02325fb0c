"""A scene as data: what a user may say, checked and in SI units; files in and out."""

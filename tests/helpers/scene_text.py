"""Text that scene files of the tests begin with."""

GLASS = """
[materials.glass]
density = 2500
young_modulus = "10 MPa"
poisson_ratio = 0.3
[[pairs]]
materials = ["glass", "glass"]
restitution = 0.6
"""
"""One material and its pair with itself."""

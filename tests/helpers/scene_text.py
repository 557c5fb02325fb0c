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
TWO_FALLING = GLASS + """
friction = 0.3
[[walls]]
name = "floor"
material = "glass"
plane = { point = [0, 0, 0], normal = [0, 0, 1] }
[[grains]]
material = "glass"
radius = 1e-3
positions = [[0, 0, 1.5e-3], [0.5e-3, 0, 4e-3]]
[time]
end = 0.02
step = 1e-5
max_speed = 0.5
[output]
formats = []
picture = false
interval = 1e-3
checkpoint_interval = 1e-3
"""
"""Two grains that fall onto a floor, without frames."""

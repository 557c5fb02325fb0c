"""Triangle meshes: reading, repair, smooth and flat pieces, closed bodies; triangles of analytic walls for drawing."""

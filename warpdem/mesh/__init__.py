"""Triangle meshes: read, mended, cut into smooth pieces, made from analytic walls for drawing."""

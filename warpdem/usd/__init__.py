"""USD stages: safe reading as scenes, geometry and motions."""

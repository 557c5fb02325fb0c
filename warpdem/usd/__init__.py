"""USD stages: read safely, as scenes, as geometry and as motions; scenes written."""

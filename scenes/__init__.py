"""The gallery: scene files and meshes, installed as data for ``warpdem demo``. There is no code here."""

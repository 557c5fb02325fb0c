"""USD stages as input: a stage is read as a scene (``scene``), or gives the geometry and motion that a scene names.

``stage`` reads a file in a process of its own (``usd.reader``), since a damaged file can crash the USD library. ``schemas``
and ``unsupported`` say which physics of a stage is taken, noted or refused; ``motion`` makes rigid motions of prims.
``tables``, ``walls`` and ``grain_groups`` build the tables of the scene. Results are written as USD elsewhere:
``warpdem.output.write_usd``; a scene too: ``warpdem.scene.write_usd``.
"""

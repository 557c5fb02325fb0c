"""Files of a run, written whole or not at all: frames, history.csv, run.json; and the readers that pictures are drawn from.

A new format of the frames is: a file ``write_NAME.py`` with a ``FrameWriter``, its entry in ``formats.FORMATS``, its name in
``warpdem.scene.settings.Output.formats``, and the schema, generated again (see CONTRIBUTING.md). Which arrays it holds,
``result_arrays`` says. If it can hold the contact network: ``Output._contacts_have_a_format``. If pictures are to be drawn from
it: a reader beside ``read_vtk``, ``drawing.rendering``, ``app.final_picture.wants_picture``, and ``app.phases`` for the index
that joins phases.

A new column of history.csv is an entry of ``history.GENERAL`` or ``history.WALL``. A new array of the grains is a field of
``core.snapshot.Snapshot``, filled in ``measure.snapshot``, and an entry of ``result_arrays.GRAIN_ARRAYS``; USD has its own
list, ``usd_attributes``.
"""

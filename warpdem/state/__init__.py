"""What changes during a run: grains, contact history, clock, streams; a checkpoint saves it (``checkpoint``).

``view`` is how all readers (guards, measures, writers) see a run at one time. ``restart`` and
``restart_*`` say what a scene takes over from the checkpoint that it starts from.
"""

"""The command ``warpdem``: a run with all its files (``run``, ``phases``), ``check``, ``demo``; summaries and warnings.

``cli`` reads the arguments. ``run_folder`` and ``run_record`` are folder and run.json of a run, ``outputs`` calls the writers.
``scene_warnings`` gathers all warnings of a scene: its own, ``step_warnings`` and ``wall_warnings``.
"""

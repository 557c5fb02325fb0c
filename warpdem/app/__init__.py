"""The command ``warpdem``: a run with all its files (``run``, ``phases``), ``check``, ``demo``; summaries and warnings.

``cli`` reads the arguments. ``run_folder`` and ``run_record`` are folder and run.json of a run, ``outputs`` calls the writers.
"""

"""Grains to and from other programs: ``export`` writes the frames of a run, ``foreign`` reads grains of other codes.

Out: ``lammps_dump`` (LAMMPS, LIGGGHTS, Ovito), ``grain_tables`` (CSV, Parquet). In: ``lammps_dump``, ``lammps_data`` and
``text_columns`` (YADE, MercuryDPM); ``state_file`` makes a state file of them, which a scene takes as ``grains.file``.
"""

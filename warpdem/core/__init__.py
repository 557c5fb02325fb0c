"""What any other part may use and what imports none of them (of the package only ``warpdem.errors``): no scene, no run.

Files and folders: ``access`` (the rule for every path that a scene names), ``atomic_file``, ``journaled_file``, ``run_lock``,
``file_names``, ``vtk_header``. Processes: ``command``, ``interrupts``, ``reader_process``, ``process_limits``, ``progress``.
The machine: ``device``, ``cpu_cores``, ``memory``, ``huge_pages``, ``threads``, ``array_view``, ``recorded_launch``,
``timers``, ``start_warp``. Kinematics: ``rigid_motion``, ``pose``. What several layers hand on: ``snapshot`` (the state at one
time, for writers and pictures), ``output_schedule``, ``key_path``.
"""

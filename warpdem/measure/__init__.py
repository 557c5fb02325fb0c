"""What is read off a run at one time, without changing it: contacts, energies, wall loads, flows, mixing, averages.

``run_readings`` is what a ``Simulation`` can be asked for; ``measures`` and ``observation`` are the columns of history.csv that
the scene's ``measures`` and ``observers`` ask for; ``snapshot`` is what a frame of the results holds.
"""

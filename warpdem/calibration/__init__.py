"""Calibration: parameters of scenes from what was measured, with the errors that measurements and runs leave.

``file`` is what is asked for, ``experiments`` runs it by sweeps, ``surface`` describes what runs measure, ``estimate`` fits the
parameters, ``search`` says what to run next, ``verdict`` what was found; ``standard`` has tests that come with warpdem.
"""

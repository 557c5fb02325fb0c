"""A run put together of its parts, and what a program changes of it between steps: what ``Simulation`` stands on.

parts           model, state, engine, streams, run loop and guards of a scene, each given what it needs
wall_motion     another motion for a driven wall
"""

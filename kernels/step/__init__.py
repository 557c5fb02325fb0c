"""The time step: loop over steps, phases of a captured graph, motion of a grain, frame terms, borders."""

"""From a scene to steps: features, kernels, time step, state, lists, launches, checkpoint."""

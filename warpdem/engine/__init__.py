"""From a scene to steps: plan, kernels, time step, state, lists, launches, checkpoint."""

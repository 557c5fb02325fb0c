"""What is to be run, derived from the scene before the first step: plan, domain, walls, schedule, limits of the time step."""

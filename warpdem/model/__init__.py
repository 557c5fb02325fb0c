"""What is to be run, made from the scene before the first step: features, domain, walls, schedule, limits of the time step."""

"""Everything that is made from a scene before step 1 and stays fixed. Contact models are not here but in ``kernels``.

    prepare               the way from the scene to the model, step by step
    features              what the scene needs: what is compiled, allocated and run
    compiled              the kernels of these features
    model                 the result, with all below
    domain, ways_out      borders and outlets of the scene, and where they stand
    walls, wall_images    walls on the device, and at their periodic images
    schedule              tables of all that changes with time and is known beforehand
    time_step, impact, travel     limits of the time step, and the step chosen
    needs                 memory that the scene takes, and numbers that float64 can compute with
    digests, past         fingerprints of the scene; what is taken over from the checkpoint it starts from

What changes during a run is in ``warpdem.state``.
"""

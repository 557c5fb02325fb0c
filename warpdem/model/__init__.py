"""Everything that is made from a scene before step 1 and stays fixed. Contact models are not here but in ``kernels``.

    prepare               the way from the scene to the model, step by step
    choose_features       what the scene needs, decided once: what is compiled, allocated and run
    features              the structs that hold it
    coefficients          numbers that the scene gives its models
    compiled              the kernels of these features
    model                 the result, with all below
    domain, exits      borders and outlets of the scene, and where they stand
    walls, wall_images    walls on the device, and at their periodic images
    schedule              tables of all that changes with time and is known beforehand
    time_step             limits of the time step, and the step chosen
    contact_cases, impact, stability_limit    the stiffest contacts, their impact, and the step that they grow at
    expected_load, travel largest speed, weight; speed beside meshes
    restitution_error     what the step changes in an impact
    needs                 memory that the scene takes, and numbers that float64 can compute with
    digests, past         fingerprints of the scene; what is taken over from the checkpoint it starts from
    decisions             what other processes make the same model of, without all grains

What changes during a run is in ``warpdem.state``.
"""

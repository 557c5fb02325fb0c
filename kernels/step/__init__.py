"""The time step: forces at t_k, then the integrator takes the grains to t_k+1.

    loop           the step: ``run``, the kernel that each CPU thread runs for a batch of steps
    forces, move   its phases: contact forces of a force call; kick, drift and what follows from the new positions
    graph          the same phases with a thread per contact or grain, for a captured graph
    structs        what the kernels of both take: what is read, what is written, which part a thread does
    read           forces, velocities and budgets of the present time
    motion         what acts on one grain, and how far it has gone since the lists were built
    schedule       what changes with time and is known beforehand, one row per force call
    dynamic_walls  walls whose motion follows from the load on them
    free_bodies    those of them with six degrees of freedom, and their exact ``free_rotation``
    frame_terms    apparent accelerations, for integrators with velocities relative to the frame
    runge_kutta    what ``integrator/rk2`` and ``integrator/rk4`` share
    orientation    rotation of grains
    border         periodic images
    region         which of the regions, in which grains leave, a place is in
    barrier        where the CPU threads meet between phases
    clock          conditions and counters of a batch of steps
    exchange       where a step calls the host in a run over several processes
    messages       rows of arrays that go from GPU to GPU

``loop`` and ``graph`` compute the same bits on a CPU.
"""

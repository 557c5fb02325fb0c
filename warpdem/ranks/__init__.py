"""One scene over several processes (MPI ranks), with the bits of one process.

Each rank owns the grains of a part of space and moves them. Behind them in memory stand copies of the grains of others that are
near (ghosts), whose state comes from their owner after every step, called for from within the step (``kernels.step.exchange``).
A contact across a border is evaluated on both ranks, the lower id first, so that it has the same bits on both, and no force
travels. Lists are rebuilt on all ranks at the same step; there grains change hands, with their contact history.

    launcher     whether a launcher of MPI started this process beside others, and how to start one
    world        what ranks tell each other
    cuts         who owns which part of space
    halo         which grains another rank sees
    portion      grains and their contacts on the way from rank to rank
    transfer     the whole, between rank 0 and all, block by block
    exchange     state of the ghosts, at every step
    answers      where films of liquid answer contacts between two ranks
    lists        neighbor lists, built on all ranks together
    rank         what one rank does
    front        the run as rank 0 shows it: it reads the whole, and tells the others what to do
    follower     the other ranks
    estimate     what a scene would exchange
    devices      the device of each rank
    ways         which exchange a run takes, and why
    staging      the exchange where steps run on a GPU, through memory of the host
    device_exchange, device_messages   the exchange within the graphs of GPUs, and NCCL, which carries it

Rank 0 decides all that hangs on time, signals and files. What is read of the run, it reads of the whole, which it gathers.
"""

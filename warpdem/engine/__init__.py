"""The engine: takes grains from one time step to the next, and knows nothing of guards, readers and writers.

Read ``program`` first: the step and the list build, every launch in its order, on one page. Around it:

    engine          what a simulation holds of all this: advance, read forces, count grains that left
    program         THE step and THE list build
    cpu             runs them on CPU threads: the host decides, a batch of steps is one launch per thread
    graph           runs them as one captured graph: the device decides (a GPU, or a CPU with resident=True)
    host_build      what the host decides in a list build: order in memory, lengths of arrays
    neighbor_list   WHEN lists are rebuilt: skins, grains inserted and removed
    contact_lists   the arrays of both lists, and how they are read
    buffers, batch, structs    memory of the lists; schedule, clock and extremes of a batch; the structs of the kernels
    flights         fast grains that fly along paths, so that the lists of the others hold
    newcomers       inserted grains are appended to the lists
    leavers, stops  grains that left the domain; states that stop a run
    pace            how many threads are used on a busy machine
    way_out         analytic walls that a grain falls past

A list build, from the step that asks for it:

1. ``kernels/step/motion.py: travelled``: after each drift, a grain further from its reference than half the inner skin
   ends the batch (``cpu``), or the body of the graph's loop.
2. ``kernels/lists/displacement.py: check_lists``: is the outer list out of date, must the host look?
3. Outer list (``program.ListBuild.build_outer``): ``cells.insert`` and ``neighbors.find_neighbors``,
   ``wall/candidates.near_features``, ``numbering``, ``neighbors.carry_contacts``, ``displacement.save_reference``. On the host
   the grains are sorted along a Z-order curve first (``host_build.outer``); in a graph they stay where they are
   (``lists/rebuild.py``).
4. Inner list (``program.ListBuild.build_inner``): ``neighbors.select_contacts``, ``wall/candidates.close_features``,
   ``numbering``, ``neighbors.fill_contacts``, which carries the contact history over, ``displacement.save_reference``.
5. Forces of the present positions, and the steps go on.

Neither list changes a bit of the result: pairs are evaluated lower id first and summed in order of partner id.
"""

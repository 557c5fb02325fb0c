"""The engine: takes grains from one time step to the next, and knows nothing of guards, readers and writers.

Read ``program`` first: the step and the list build, every launch in its order, on one page. Around it:

    run_loop        the order of things: lists made valid, a batch of steps, insertion of grains
    engine          what a simulation holds of all this: advance, read forces, count grains that left
    program         THE step and THE list build
    cpu             runs them on CPU threads: the host decides, a batch of steps is one launch per thread
    graph           runs them as one captured graph: the device decides (a GPU, or a CPU with resident=True)
    graph_of_stages the same over several processes: a graph of each stage, between which the host exchanges grains
    graph_of_steps  the same, where messages go from GPU to GPU: graphs of a fixed number of steps, messages included
    host_build      what the host decides in a list build: order in memory, lengths of arrays
    cpu_lists       on CPU threads: check and inner list in one launch each
    neighbor_list   WHEN the host builds lists: skins, grains inserted and removed
    contact_lists   the arrays of both lists, and how they are read
    buffers, batch, structs, list_structs    memory of the lists; schedule, clock and extremes of a batch; the structs of
                    the kernels of the step and of the lists
    flights         fast grains that fly along paths, so that the lists of the others hold
    newcomers       inserted grains are appended to the lists
    leavers, stops  grains that left the domain; states that stop a run
    pace            how many threads are used on a busy machine
    open_below      analytic walls that a grain falls past

A list build, from the step that asks for it:

1. ``kernels/step/motion.py: travelled``: after the last drift of a step, a grain further from its reference than the inner
   list allows, off its path, or in an outlet (where the step does not remove it itself) ends the batch (``cpu``), or the body
   of the graph's loop.
2. ``kernels/lists/displacement.py: check_lists``: what has become of each grain. Without a graph the next call of
   ``RunLoop.advance`` launches it (``NeighborLists.update``) and the host decides: grains that left are taken out; the lists
   hold, the inner one is built, or both are; where it is the inner one alone, CPU threads go on with it in the same launch
   (``kernels/lists/inner.py``). In a graph the clock's conditions decide, and ``lists/rebuild.py: ask_outer``
   whether the outer list may be built there or the host is asked.
3. Outer list (``program.ListBuild.build_outer``). The host first sorts the grains along a Z-order curve
   (``HostBuild.outer``), on a CPU only from time to time; in a graph they stay where they are. Then
   ``displacement.set_allowances``: how far each grain may move; ``neighbors.count_in_cells``, ``cells.start_lines`` and
   ``neighbors.sort_by_cell``, which sort the grains by cell,
   ``find_neighbors``, ``numbering`` where rows are counted first (GPU),
   ``wall/candidates.near_features``, which counts, ``numbering``;
   ``outer_fits``: the host gives the arrays their length, a graph asks the host where they are too short; ``find_neighbors``
   again where rows were counted first, ``neighbors.carry_contacts`` where there is an old list, ``replace_outer``,
   ``near_features`` again, which writes, ``move_wall_contacts`` (by the host ``wall/candidates.carry_wall_contacts``, in a
   graph two kernels of ``lists/rebuild.py``), ``displacement.save_reference``.
4. Inner list (``program.ListBuild.build_inner``): ``contact_batches.select_contacts``, ``wall/candidates.close_features``,
   ``numbering``; ``inner_fits``, as above; ``contact_batches.clear_contacts``, ``fill_contacts``, which carries the contact
   history over, ``adopt_history``, ``displacement.save_reference``. On a CPU all of it is ``kernels/lists/inner.py``, a launch
   per thread, again with longer arrays where they were too short.
5. Forces of the present positions: in a graph within ``inner_fits``, else first thing in the next batch. The steps go on.

Neither list changes a bit of the result: pairs are evaluated lower id first and summed in order of partner id.
"""

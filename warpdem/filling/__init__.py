"""Where grains come from: at the start (``initial_grains``) and while the run goes on (``inlet``, for the scene's streams).

At the start they are listed in the scene, read from a file (``grain_file``), or fill a space: ``fill_space`` finds the space,
``fill_request`` draws the sizes, ``packing`` finds places without large overlaps. ``start_check`` refuses a start that
cannot run.
"""

"""Neighbor lists: which grains may touch, and until when that holds. The order of the kernels: ``warpdem.engine.program``.

    cells           grains sorted by cell, one grid per size class
    neighbors       the outer list: rows of neighbors
    near_runs       how a CPU core finds them: several candidates at a time
    contact_batches the inner list: contacts that the forces go through
    inner           the inner list as CPU threads build it, in one launch each
    numbering       where the contacts, force slots and wall slots of each grain begin
    displacement    how far grains have moved since the lists were built
    rebuild         the parts of an outer list build that only a captured graph needs
    flight, path    fast grains that fly along known paths, so that the lists of the others hold

What is listed changes no bit of a result.
"""

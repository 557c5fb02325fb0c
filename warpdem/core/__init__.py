"""What the parts share and what knows none of them: paths, threads, processes, the start of Warp, rigid placements."""

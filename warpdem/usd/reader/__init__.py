"""Program that opens a USD file and hands back plain arrays; `warpdem.usd.stage` runs it in a process of its own.

A damaged file can make the USD library crash, loop or allocate any amount of memory; in a process of its own this does not
end the run. The program imports only NumPy, the USD library and its own files, so that it starts fast.
"""

"""Program that opens a USD file and hands back plain arrays; `warpdem.usd.stage` runs it in a process of its own.

A damaged file can make the USD library crash, loop or ask for any amount of memory; here that ends this process and not
the run. Its files import NumPy, the USD library and what is beside them, so that it starts fast.
"""

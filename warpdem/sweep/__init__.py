"""Sweeps: a scene run with the changes of each row of a table, one folder per row, in several processes.

``table`` makes the rows (a file, a grid, samples), ``row`` is the folder of one and what it says, ``worker`` runs one in a
process of its own, ``executors`` are what runs several at once, ``quantities`` what is read from a row, ``sweep`` the whole.
The folders are the only state: whatever is lost, the same command goes on.
"""

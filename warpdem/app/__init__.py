"""The commands: a run with all its files, check, demo, summary, progress."""

"""What changes during a run and what a checkpoint keeps: particles and the history of their contacts."""

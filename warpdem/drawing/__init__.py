"""Pictures and films from the files of a run, without a screen."""

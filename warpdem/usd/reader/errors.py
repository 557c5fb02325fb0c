"""What ends the reader with a reason."""



class Refused(Exception):
    """The file cannot be used; the text says why."""

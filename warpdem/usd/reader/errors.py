"""The error of a file that is refused."""



class Refused(Exception):
    """The file cannot be used; the text gives the reason."""

"""Progress of work, for whoever watches it."""


def ignore_progress(_share: float) -> None:
    """Do nothing: the progress callback of calls that nobody watches."""

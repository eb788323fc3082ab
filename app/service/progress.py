"""Progress of work, for whoever watches it."""

from app.engine.interface import ProgressCallback


def ignore_progress(_share: float) -> None:
    """Do nothing: the progress callback of calls that nobody watches."""


class LatestProgress:
    """The progress callback of work that a job may follow later."""

    def __init__(self) -> None:
        self._share: float | None = None
        self._on_progress: ProgressCallback = ignore_progress

    def __call__(self, share: float) -> None:
        """Report the share that is done."""
        self._share = share
        self._on_progress(share)

    def follow(self, on_progress: ProgressCallback) -> None:
        """Report to a callback from now on, beginning with the last share."""
        self._on_progress = on_progress
        if self._share is not None:
            on_progress(self._share)

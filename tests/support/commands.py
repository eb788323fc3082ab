"""A run of the ``geodesic`` command: its exit code, and what it printed."""

from collections.abc import Callable


class Ran:
    """Exit code and output of a command."""

    def __init__(self, code: int, out: str, err: str) -> None:
        self.code, self.out, self.err = code, out, err

    def figure(self, name: str) -> str:
        """Return what is printed after a name at the start of a line."""
        return next(
            row.removeprefix(name).strip() for row in self.out.splitlines() if row.startswith(name)
        )


Run = Callable[..., Ran]


def error_line(ran: Ran) -> str:
    assert ran.out == ""
    assert ran.err.startswith("error: ")
    assert ran.err.count("\n") == 1
    return ran.err

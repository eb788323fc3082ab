"""What is found when it is first asked for, under the control of who asks."""

from collections.abc import Callable
from typing import Generic, TypeVar

from geodesic_core.control import Control

T = TypeVar("T")


class Lazy(Generic[T]):
    """A value that is there already, or is found at the first call that is not stopped."""

    def __init__(self, find: Callable[[Control], T], found: T | None = None) -> None:
        self._find = find
        self._found = found

    @property
    def found(self) -> T | None:
        """The value, if it is there."""
        return self._found

    def get(self, control: Control) -> T:
        """Return the value.

        Raises
        ------
        GeodesicError
            As finding it does; the next call looks for it anew.
        """
        if self._found is None:
            self._found = self._find(control)
        return self._found

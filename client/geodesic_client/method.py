"""Methods that `Client` and `AsyncClient` share: called on the one, awaited on the other."""

from collections.abc import Callable, Coroutine
from functools import wraps
from typing import Any, Generic, ParamSpec, Protocol, TypeVar, overload

from geodesic_client.flow import Flow

P = ParamSpec("P")
T = TypeVar("T")


class Runner(Protocol):
    """What runs a conversation and returns its outcome."""

    def run(self, flow: Flow[T]) -> T:
        """Run a conversation."""
        ...


class AsyncRunner(Protocol):
    """What runs a conversation as a coroutine."""

    def run_async(self, flow: Flow[T]) -> Coroutine[Any, Any, T]:
        """Run a conversation."""
        ...


class Method(Generic[P, T]):
    """A method that runs the conversation which a function begins."""

    def __init__(self, begin: Callable[P, Flow[T]]) -> None:
        self._begin = begin
        self.__doc__ = begin.__doc__

    @overload
    def __get__(self, instance: Runner, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, instance: AsyncRunner, owner: type
    ) -> Callable[P, Coroutine[Any, Any, T]]: ...
    @overload
    def __get__(self, instance: None, owner: type) -> "Method[P, T]": ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the function that runs on an instance."""
        if instance is None:
            return self
        run = instance.run if hasattr(instance, "run") else instance.run_async

        @wraps(self._begin)
        def call(*args: P.args, **kwargs: P.kwargs) -> Any:
            return run(self._begin(*args, **kwargs))

        return call

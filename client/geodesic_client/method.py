"""Methods that `Client` and `AsyncClient` share: called on the one, awaited on the other."""

from collections.abc import Callable, Coroutine
from functools import wraps
from inspect import Parameter, signature
from typing import Any, Generic, ParamSpec, Protocol, TypeVar, get_args, overload

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
        of_begin = signature(begin)
        *_, outcome = get_args(of_begin.return_annotation)
        self._signature = of_begin.replace(return_annotation=outcome)

    @overload
    def __get__(self, instance: Runner, owner: type) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, instance: AsyncRunner, owner: type
    ) -> Callable[P, Coroutine[Any, Any, T]]: ...
    @overload
    def __get__(self, instance: None, owner: type) -> Callable[..., T]: ...
    def __get__(self, instance: Any, owner: type) -> Any:
        """Return the function that runs on an instance; of a class, one for `help` alone."""
        run = getattr(instance, "run", None) or getattr(instance, "run_async", None)

        @wraps(self._begin)
        def call(*args: P.args, **kwargs: P.kwargs) -> Any:
            if run is None:
                raise TypeError(f"{self._begin.__name__} is called on a client, not on its class")
            return run(self._begin(*args, **kwargs))

        own = Parameter("self", Parameter.POSITIONAL_ONLY)
        parameters = [*([own] if instance is None else ()), *self._signature.parameters.values()]
        call.__signature__ = self._signature.replace(parameters=parameters)  # type: ignore[attr-defined]
        return call

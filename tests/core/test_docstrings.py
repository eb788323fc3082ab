"""What docstrings say of parameters is what there is."""

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import geodesic_core as gc

CONTROLS = {"progress", "cancel", "deadline_s", "memory_limit"}


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield what callers call: functions, classes, and the methods of classes."""
    for module, names in ((gc, gc.__all__), (gc.samples, ("knot", "plane", "sphere"))):
        for name in names:
            thing = getattr(module, name)
            if inspect.isroutine(thing):
                yield name, thing
            elif inspect.isclass(thing):
                yield name, thing
                for method, member in inspect.getmembers(thing, inspect.isroutine):
                    is_own = (getattr(member, "__module__", None) or "").startswith("geodesic_core")
                    if is_own and not method.startswith("_"):
                        yield f"{name}.{method}", member


PUBLIC = dict(public())


def documented(thing: Callable[..., Any]) -> list[str] | None:
    """Return the names in the section on parameters, in order; None where there is none."""
    text = inspect.getdoc(thing) or ""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", text, re.MULTILINE | re.DOTALL)
    if section is None:
        return None
    rows = [row for row in section[1].splitlines() if row and not row.startswith(" ")]
    return [name for row in rows for name in row.split(":")[0].strip().split(", ")]


def parameters_of(thing: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(thing).parameters if name not in ("self", "cls")]


@pytest.mark.parametrize("name", PUBLIC)
def test_documented_parameters_are_the_real_ones(name: str) -> None:
    """All of them, in their order; what controls a call may be left to `Control`."""
    thing = PUBLIC[name]
    assert inspect.getdoc(thing), f"{name} has no docstring"
    told = documented(thing)
    if told is not None:
        real = parameters_of(thing)
        assert told in (real, [each for each in real if each not in CONTROLS])


@pytest.mark.parametrize(
    "name", [name for name, each in PUBLIC.items() if inspect.isfunction(each)]
)
def test_functions_of_several_arguments_tell_of_them(name: str) -> None:
    """Methods of a solver refer to the functions of the same name."""
    thing = PUBLIC[name]
    if len(set(parameters_of(thing)) - CONTROLS) > 2:
        assert documented(thing) is not None or "Do as `" in (thing.__doc__ or "")


def test_there_are_docstrings_to_check() -> None:
    assert sum(documented(each) is not None for each in PUBLIC.values()) > 8

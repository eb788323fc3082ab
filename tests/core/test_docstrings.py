"""Docstrings: parameters as they are, results with shapes and errors, and examples that run."""

import doctest
import inspect
import pydoc
import re
import sys
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
import pytest

import geodesic_core as gc

CONTROLS = {"progress", "cancel", "deadline_s", "memory_limit"}
PACKAGES = {
    "gc": gc,
    "gc.brain": gc.brain,
    "gc.errors": gc.errors,
    "gc.samples": gc.samples,
    "gc.terrain": gc.terrain,
}


def exported(package: Any) -> list[str]:
    """Return the names of a package's own functions and classes."""
    if hasattr(package, "__all__"):
        return [name for name in package.__all__ if not inspect.ismodule(getattr(package, name))]
    own = [name for name, thing in vars(package).items() if callable(thing) and name[0] != "_"]
    return [name for name in own if getattr(package, name).__module__ == package.__name__]


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield all that users call: functions, classes, and the methods of classes."""
    for prefix, package in PACKAGES.items():
        for name in exported(package):
            thing = getattr(package, name)
            if inspect.isroutine(thing):
                yield f"{prefix}.{name}", thing
            elif inspect.isclass(thing):
                yield f"{prefix}.{name}", thing
                for method, member in inspect.getmembers(thing, inspect.isroutine):
                    is_own = (getattr(member, "__module__", None) or "").startswith("geodesic_core")
                    if is_own and callable(member) and not method.startswith("_"):
                        yield f"{prefix}.{name}.{method}", member


PUBLIC = dict(public())
ROUTINES = [name for name, thing in PUBLIC.items() if inspect.isroutine(thing)]
RECORDS = {
    "gc.DistanceField",
    "gc.ErrorBound",
    "gc.GeodesicPath",
    "gc.MeshReport",
    "gc.SurfaceCurve",
}
RECORDS |= {f"gc.brain.{name}" for name in gc.brain.__all__ if name[0].isupper()}
RECORDS |= {"gc.MatrixFile", "gc.Nearest", "gc.Sample", "gc.SearchStep", "gc.SweepStats"}
RECORDS |= {
    "gc.Border",
    "gc.Cells",
    "gc.Certificate",
    "gc.CheapestPath",
    "gc.CostField",
    "gc.CutMesh",
    "gc.FarthestPoints",
    "gc.MeanPoint",
    "gc.RelaxedPoints",
    "gc.LogMap",
    "gc.Polar",
    "gc.Profile",
    "gc.StraightLine",
    "gc.SweepSteps",
    "gc.SweepWindows",
    "gc.TangentFrames",
    "gc.terrain.Terrain",
}
"""Classes whose attributes are documented one by one: users read them, and make none."""


SCREEN = 12 * 100
"""Characters that a signature in `help` may have: twelve lines"""


def section(thing: Callable[..., Any], title: str) -> str | None:
    """Return the text of a section of a docstring; None where it has none."""
    found = re.search(
        rf"^{title}\n-+\n(.*?)(?=^\w+\n-+\n|\Z)",
        inspect.getdoc(thing) or "",
        re.MULTILINE | re.DOTALL,
    )
    return found and found[1]


def documented(thing: Callable[..., Any]) -> list[str]:
    """Return the names in the section on parameters, in order."""
    rows = (section(thing, "Parameters") or "").splitlines()
    return [
        name
        for row in rows
        if row and not row.startswith(" ")
        for name in row.split(":")[0].strip().split(", ")
    ]


def parameters_of(thing: Callable[..., Any]) -> list[str]:
    return [name for name in inspect.signature(thing).parameters if name not in ("self", "cls")]


def test_all_that_users_call_is_looked_at() -> None:
    assert len(ROUTINES) > 40
    assert {"gc.exact_distance", "gc.Solver.nearest", "gc.samples.knot"} < set(ROUTINES)
    assert {"gc.errors.NoPath", "gc.Control"} < set(PUBLIC)
    assert set(PUBLIC) > RECORDS


@pytest.mark.parametrize("name", [name for name in PUBLIC if name not in RECORDS])
def test_documented_parameters_are_the_real_ones(name: str) -> None:
    """All of them, in their order."""
    thing = PUBLIC[name]
    if inspect.isclass(thing) and "__init__" not in vars(thing):
        return  # an exception with a message alone
    assert documented(thing) == parameters_of(thing)


@pytest.mark.parametrize("name", ROUTINES)
def test_routines_tell_their_results(name: str) -> None:
    thing = PUBLIC[name]
    if inspect.signature(thing).return_annotation not in (None, "None"):
        assert section(thing, "Returns") or section(thing, "Yields"), "no section on the result"
    if set(parameters_of(thing)) >= CONTROLS:
        assert "DeadlineExceeded" in (section(thing, "Raises") or "")


def test_results_that_are_arrays_tell_shape_and_type() -> None:
    arrays = [name for name in ROUTINES if "ndarray" in (section(PUBLIC[name], "Returns") or "")]
    assert len(arrays) > 6
    for name in arrays:
        text = section(PUBLIC[name], "Returns") or ""
        assert "dict" in text or re.search(r"\(\w+.*\)|shape", text), name
        assert "dict" in text or "float64" in text, name


@pytest.mark.parametrize("name", PUBLIC)
def test_each_has_an_example(name: str) -> None:
    assert ">>> " in (section(PUBLIC[name], "Examples") or "")


@pytest.mark.parametrize("name", ROUTINES)
def test_help_shows_a_signature_that_fits_on_a_screen(name: str) -> None:
    """Types have names there, such as ``MeshLike``, which would else be pages of unions."""
    text = pydoc.plain(pydoc.render_doc(PUBLIC[name]))
    last = name.rpartition(".")[2]
    (shown,) = (line for line in text.splitlines() if line.startswith(f"{last}("))
    assert len(shown) <= SCREEN
    if last in vars(gc.Solver):
        assert len(shown) <= SCREEN / 2
        assert "numpy._typing" not in shown


def examples() -> Iterator[doctest.DocTest]:
    """Yield the examples of the package, of each public name, and of its methods and properties."""
    finder = doctest.DocTestFinder()
    names = {"numpy": np, "np": np, "gc": gc}
    yield from doctest.DocTestFinder(recurse=False).find(gc, "gc", globs=names)
    for prefix, package in PACKAGES.items():
        for name in exported(package):
            thing = getattr(package, name)
            if inspect.isclass(thing) or inspect.isroutine(thing):
                module = sys.modules[thing.__module__]
                yield from finder.find(thing, f"{prefix}.{name}", module, globs=names)
                for attribute, member in vars(thing).items() if inspect.isclass(thing) else ():
                    if isinstance(member, cached_property):
                        full = f"{prefix}.{name}.{attribute}"
                        yield from finder.find(member.func, full, module, globs=names)


EXAMPLES = {test.name: test for test in examples() if test.examples}


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name: str) -> None:
    told: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(EXAMPLES[name], out=told.append, clear_globs=False)
    assert not told, "".join(told)


def test_examples_of_methods_and_properties_are_found() -> None:
    assert {"gc", "gc.Solver.nearest", "gc.DistanceField.gradient"} < set(EXAMPLES)

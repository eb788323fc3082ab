"""The package's face: its names, and the signatures behind them."""

import inspect

import pytest

import geodesic_core as gc

METHODS = [name for name, _ in inspect.getmembers(gc.Solver, inspect.isfunction) if name[0] != "_"]


def test_dir_lists_the_public_names_and_nothing_else():
    assert dir(gc) == sorted(gc.__all__)
    assert all(hasattr(gc, name) for name in gc.__all__)


def test_errors_and_samples_are_reachable_by_name():
    assert issubclass(gc.errors.InvalidMesh, gc.GeodesicError)
    assert len(gc.samples.plane(2).faces) == 2


def test_a_solver_has_each_question_on_one_mesh():
    functions = [getattr(gc, name) for name in gc.__all__ if inspect.isfunction(getattr(gc, name))]
    signatures = {each.__name__: list(inspect.signature(each).parameters) for each in functions}
    answering = [
        name
        for name, given in signatures.items()
        if given[:1] == ["mesh"] and "memory_limit" in given and "out" not in given
    ]
    assert sorted(METHODS) == sorted(answering)


@pytest.mark.parametrize("name", METHODS)
def test_methods_of_a_solver_have_the_arguments_of_the_functions(name):
    function = inspect.signature(getattr(gc, name))
    method = inspect.signature(getattr(gc.Solver, name))
    assert list(method.parameters.values())[1:] == list(function.parameters.values())[1:]
    assert method.return_annotation == function.return_annotation

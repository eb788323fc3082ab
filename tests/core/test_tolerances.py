"""Each tolerance is tested as the bound that its docstring promises, beside what it bounds."""

import ast
from pathlib import Path

import pytest

from geodesic_core import tolerances


@pytest.fixture(scope="module")
def tests() -> dict[str, set[str]]:
    """The name of each test of the library, and the names that it uses."""
    return {
        node.name: {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
        for path in sorted(Path(__file__).parent.rglob("test_*.py"))
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef)
    }


@pytest.mark.parametrize("name", [*filter(str.isupper, vars(tolerances))])
def test_each_tolerance_is_tested(name: str, tests: dict[str, set[str]]) -> None:
    """By a test that has its name and measures against its value."""
    named = [names for test, names in tests.items() if test.startswith(f"test_{name.lower()}")]
    assert any(name in names for names in named)

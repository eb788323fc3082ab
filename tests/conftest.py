"""What all tests share: how much to run, and on what."""

import os
from collections.abc import Callable

import pytest
from hypothesis import settings

import geodesic_core as gc

pytest_plugins = ["tests.support.service"]

WITHOUT_JIT = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "jit: too long for kernels in pure Python; skipped there")
    settings.register_profile(
        "slice",
        derandomize=True,
        max_examples=5 if WITHOUT_JIT else 15,
        deadline=None,
        database=None,
    )
    settings.register_profile(
        "full", derandomize=True, max_examples=2000, deadline=None, database=None
    )
    settings.load_profile("slice" if "not full" in config.option.markexpr else "full")


@pytest.fixture(scope="session", autouse=True)
def compiled_kernels(worker_id: str) -> None:
    """Compile all kernels, for minutes on a fresh checkout; then all processes load them.

    Every other process of pytest-xdist begins at the other end, so that two have one half each.
    """
    if WITHOUT_JIT:
        return
    mesh = gc.TriangleMesh(*gc.samples.plane(8))
    vertex = int(mesh.faces[0, 0])
    curve = gc.Curve(mesh.faces[0, :2].tolist())
    steps: list[Callable[[], object]] = [
        gc.warm_up,
        lambda: gc.exact_distance(mesh, vertex).isolines([0.1]),
        lambda: gc.distance_matrix(mesh, [0], [1]),
        lambda: gc.approximate_distance(mesh, curve),
        lambda: gc.exact_distance(mesh, curve).isolines([0.1]),
    ]
    for step in steps if worker_id in ("master", "gw0") else reversed(steps):
        step()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: "tests/page" not in item.nodeid)  # the longest files go first
    if WITHOUT_JIT:
        for item in items:
            if item.get_closest_marker("jit"):
                item.add_marker(pytest.mark.skip(reason="kernels run in pure Python"))
    if "not full" in config.option.markexpr:
        kept = _slice_of(items, 3 if WITHOUT_JIT else 4)
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = [item for item in items if item in kept]


def _slice_of(items: list[pytest.Item], most: int) -> set[pytest.Item]:
    """Return of each test so many of its cases, evenly spread; and whatever only runs in full."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if not item.get_closest_marker("full"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    kept = {item for item in items if item.get_closest_marker("full")}
    for each in cases.values():
        count = min(most, len(each))
        kept.update(each[i * len(each) // count] for i in range(count))
    return kept

"""What all tests share: how much to run, and on what."""

import os

import pytest
from hypothesis import settings

WITHOUT_JIT = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "jit: too long for kernels in pure Python; skipped there")
    settings.register_profile(
        "slice",
        derandomize=True,
        max_examples=8 if WITHOUT_JIT else 20,
        deadline=None,
        database=None,
    )
    settings.register_profile(
        "full", derandomize=True, max_examples=2000, deadline=None, database=None
    )
    settings.load_profile("slice" if "not full" in config.option.markexpr else "full")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if WITHOUT_JIT:
        for item in items:
            if item.get_closest_marker("jit"):
                item.add_marker(pytest.mark.skip(reason="kernels run in pure Python"))
    if "not full" in config.option.markexpr:
        kept = _slice_of(items, 4 if WITHOUT_JIT else 6)
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

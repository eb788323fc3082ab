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
        max_examples=20 if WITHOUT_JIT else 60,
        deadline=None,
        database=None,
    )
    settings.register_profile(
        "full", derandomize=True, max_examples=2000, deadline=None, database=None
    )
    settings.load_profile("slice" if "not full" in config.option.markexpr else "full")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if WITHOUT_JIT:
        for item in items:
            if item.get_closest_marker("jit"):
                item.add_marker(pytest.mark.skip(reason="kernels run in pure Python"))

"""The tiers of tests, and the kernels that they share; ``tests/__init__.py`` tells of both."""

import gc
import os
import random
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

import geodesic_core

gc.disable()  # until all tests are collected: to look for garbage would take half of the time

pytest_plugins = [
    "tests.support.azure",
    "tests.support.databases",
    "tests.support.logs",
    "tests.support.postgres",
    "tests.support.s3",
    "tests.support.gcs",  # after what it imports, as the next
    "tests.support.against",
    "tests.support.service",
]

WITHOUT_JIT = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")

MARKER_OF_FOLDER = {"service": "service", "page": "page"}
LONGEST = (
    "test_cluster.py",
    "test_page.py",
    "test_process.py",
    "test_replicas.py",
    "test_object_store.py",
    "test_agreement.py",
    "test_document_sessions.py",
    "test_start.py",
    "test_logs.py",
)
NOT_QUICK = ("service", "page", "slow")
FULL_ONLY = ("full",) if WITHOUT_JIT else ("full", "plain")
EXAMPLES = {"quick": 4, "slice": 6, "full": 2000, "interpreted": 4}
"""Random examples of a property, by tier; kernels as plain Python take a hundred times as long."""

QUICK_SLICE = 2
MOST_CASES = 8
"""Cases of each test in the rooms of `tests/core`, at most, unless it has a slice of its own"""
CASES_WITHOUT_JIT = 1
"""Cases of each test; one reaches nearly every line."""
CASES_OF_READERS = 6
"""Cases of each test of files, each of which reaches other lines, and hardly any kernel."""


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("tiers")
    group.addoption("--quick", action="store_true", help="only tests without service and browser")
    group.addoption("--full", action="store_true", help="long suites whole, not as seeded slices")


def pytest_configure(config: pytest.Config) -> None:
    for name, count in EXAMPLES.items():
        settings.register_profile(
            name,
            derandomize=True,
            max_examples=count,
            deadline=None,
            database=None,
            suppress_health_check=[HealthCheck.too_slow],  # it counts seconds
        )
    profile = "quick" if config.option.quick else "slice"
    if WITHOUT_JIT:
        profile = "interpreted"
    settings.load_profile("full" if config.option.full else profile)


def _runs_all(config: pytest.Config) -> bool:
    narrowed = config.option.keyword or config.option.markexpr
    return not narrowed and config.args_source is not pytest.Config.ArgsSource.ARGS


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile all kernels before all tests; where only some are to run, those that they call."""
    is_controller = not hasattr(session.config, "workerinput")
    if is_controller and not WITHOUT_JIT and _runs_all(session.config):
        geodesic_core.compile_kernels()


class OnePageScheduling(LoadFileScheduling):
    """The tests of a file run in one process, and so do all of the page: they share a browser."""

    def _split_scope(self, nodeid: str) -> str:
        return "page" if nodeid.startswith("tests/page/") else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> OnePageScheduling:
    return OnePageScheduling(config, log)


def pytest_collection_finish() -> None:
    gc.freeze()  # tests and imports are for ever: to look through them takes a second
    gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    root = Path(__file__).parent
    for item in items:
        marker = MARKER_OF_FOLDER.get(item.path.relative_to(root).parts[0])
        if marker:
            item.add_marker(marker)
        if WITHOUT_JIT and item.get_closest_marker("jit"):
            item.add_marker(pytest.mark.skip(reason="kernels run in pure Python"))
    _mix(items)
    if not config.option.full:
        _deselect(config, items, FULL_ONLY)
        _deselect_beyond_slices(config, items)
        if _runs_all(config):
            _deselect_beyond_file_slices(config, items)
    if config.option.quick:
        _deselect(config, items, NOT_QUICK)


def _mix(items: list[pytest.Item]) -> None:
    """Spread the files that wait, for services and browsers, evenly among those that compute.

    Processors idle where all wait, and tests take long where all compute. The longest go first.
    """
    waiting, computing = (
        list(dict.fromkeys(item.path for item in items if _waits(item) == waits))
        for waits in (True, False)
    )
    place = {
        path: number / len(paths)
        for paths in (waiting, computing)
        for number, path in enumerate(paths)
    }
    items.sort(key=lambda item: (item.path.name not in LONGEST, place[item.path], item.path))


def _waits(item: pytest.Item) -> bool:
    return item.path.parent.name in MARKER_OF_FOLDER


def _deselect(config: pytest.Config, items: list[pytest.Item], markers: tuple[str, ...]) -> None:
    _keep(config, items, lambda item: not any(map(item.get_closest_marker, markers)))


def _deselect_beyond_slices(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a seeded sample of the cases of each test that has a slice."""
    cases: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        cases[_test_of(item)].append(item)
    beyond: set[pytest.Item] = set()
    for name, each in cases.items():
        size = min(len(each), _size_of_slice(config, each[0]))
        chosen = random.Random(name).sample(range(len(each)), size)
        beyond.update(item for number, item in enumerate(each) if number not in chosen)
    _keep(config, items, lambda item: item not in beyond)


def _deselect_beyond_file_slices(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep a seeded sample of the tests of each file that has one."""
    tests: dict[tuple[Path, int], dict[str, None]] = defaultdict(dict)
    for item in items:
        if marker := item.get_closest_marker("file_slice"):
            tests[item.path, int(marker.args[0])][_test_of(item)] = None
    chosen = {
        name
        for (path, size), names in tests.items()
        for name in random.Random(path.name).sample(list(names), min(size, len(names)))
    }
    _keep(
        config,
        items,
        lambda item: item.get_closest_marker("file_slice") is None or _test_of(item) in chosen,
    )


def _test_of(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[0]


def _size_of_slice(config: pytest.Config, item: pytest.Item) -> int:
    if WITHOUT_JIT and item.get_closest_marker("plain"):
        return MOST_CASES
    if WITHOUT_JIT:
        return CASES_OF_READERS if item.path.parent.name == "io" else CASES_WITHOUT_JIT
    marker = item.get_closest_marker("slice")
    if marker is None:
        is_in_room = item.path.parent.parent == Path(__file__).parent / "core"
        return MOST_CASES if is_in_room and not config.option.quick else sys.maxsize
    return QUICK_SLICE if config.option.quick else int(marker.args[0])


def _keep(
    config: pytest.Config, items: list[pytest.Item], condition: Callable[[pytest.Item], bool]
) -> None:
    selected = [item for item in items if condition(item)]
    config.hook.pytest_deselected(items=[item for item in items if not condition(item)])
    items[:] = selected

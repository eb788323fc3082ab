import ast
import os
import re
from pathlib import Path

import pytest
from pydantic import SecretStr, ValidationError

from app.settings import GIB, LIBRARY_VARIABLES, MIB, Settings, available_memory, variable_of
from tests.support.service import distances, serving, upload_sample
from tests.support.syntax import syntax_tree

TESTS = Path(__file__).parents[1]
LIBRARY = TESTS.parent / "geodesic_core"

TEXTS = {
    "store": ("/somewhere", Path("/somewhere")),
    "copies": ("/elsewhere", Path("/elsewhere")),
    "state": ("postgresql://a:b@c/d", SecretStr("postgresql://a:b@c/d")),
    "worker_memory_bytes": ("3000000000", 3_000_000_000),
    "deadline_s": ("0.5", 0.5),
    "cancel_grace_s": ("0.25", 0.25),
    "store_evict": ("lru", "lru"),
    "auth": ("on", "on"),
    "engine": ("ray", "ray"),
    "root_path": ("/geodesic", "/geodesic"),
    "log_format": ("json", "json"),
    "log_probes": ("on", "on"),
    "api_keys": ("", ()),
    "trusted_proxies": ("10.0.0.1, fd00::/8", ("10.0.0.1", "fd00::/8")),
    "allowed_hosts": ("a.org, *.b.net", ("a.org", "*.b.net")),
    "cors_origins": ("https://a.org, http://b:80", ("https://a.org", "http://b:80")),
}
"""What a variable says, and what is understood; all others are whole numbers."""


def test_every_setting_is_an_environment_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {name: TEXTS.get(name, ("7", 7)) for name in Settings.model_fields}
    for name, (text, _) in given.items():
        monkeypatch.setenv(variable_of(name), text)

    settings = Settings()

    assert settings.model_dump() == {name: value for name, (_, value) in given.items()}


@pytest.mark.parametrize(
    ("url", "folder"),
    [
        ("file:///srv/my%20meshes", "/srv/my meshes"),
        ("file://localhost/srv/store", "/srv/store"),
        ("srv/store", "srv/store"),
    ],
)
def test_the_store_is_a_folder_or_its_url(
    monkeypatch: pytest.MonkeyPatch, url: str, folder: str
) -> None:
    monkeypatch.setenv("GEODESIC_STORE", url)

    assert Settings().store == Path(folder)


def test_a_store_at_a_url_has_a_folder_here_besides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEODESIC_STORE", "s3://bucket/meshes")
    monkeypatch.setenv("GEODESIC_COPIES", "/srv/copies")

    assert Settings().store == "s3://bucket/meshes"
    assert Settings().folder == Path("/srv/copies")


@pytest.mark.parametrize(
    "url", ["", "ftp://x.org/meshes", "file://elsewhere/srv", "https://x.org/"]
)
def test_a_store_that_is_no_folder_here_stops_the_start(
    monkeypatch: pytest.MonkeyPatch, url: str
) -> None:
    monkeypatch.setenv("GEODESIC_STORE", url)

    with pytest.raises(ValidationError, match="is not a folder of this machine"):
        Settings()


@pytest.mark.slow
def test_every_setting_is_put_to_use_in_a_test() -> None:
    unused = set(Settings.model_fields) - USED_BELOW
    for path in TESTS.rglob("*.py"):
        text = path.read_text()
        if path != Path(__file__) and any(name in text.lower() for name in unused):
            named = names_in(syntax_tree(path))
            unused -= {name for name in unused if {name, variable_of(name)} & named}

    assert not unused


def names_in(module: ast.Module) -> set[str]:
    """Return the names of arguments, and the texts, in a module."""
    names = {node.arg for node in ast.walk(module) if isinstance(node, ast.keyword) and node.arg}
    texts = (node.value for node in ast.walk(module) if isinstance(node, ast.Constant))
    return names | {text for text in texts if isinstance(text, str)}


USED_BELOW = {"results_bytes"}

WHOLE = {"Accept-Encoding": "identity"}
"""Compressed, the results would be so small that they were in memory as well."""


@pytest.mark.service
def test_results_bytes(tmp_path: Path) -> None:
    with serving(tmp_path, results_bytes=300_000) as client:
        mesh_id = upload_sample(client, "plane", 10_000)
        timings = []
        for vertex in (0, 0, 1, 2, 3, 4, 5, 6, 0):
            answer = distances(client, mesh_id, WHOLE, sources=[{"vertex": vertex}])
            timings.append(answer.headers["server-timing"])

    assert [timing == "kept" for timing in timings] == [False, True] + 7 * [False]


def test_defaults_are_those_of_the_contract() -> None:
    settings = Settings()

    assert settings.max_upload_bytes == 512 * MIB
    assert settings.max_query_bytes == 4 * MIB
    assert settings.max_faces == 5_000_000
    assert settings.max_json_values == 2_000_000
    assert settings.max_sources == 10_000
    assert settings.max_matrix_cells == 10_000_000
    assert settings.queue_size == 64
    assert settings.deadline_s == 120
    assert settings.workers == len(os.sched_getaffinity(0))
    assert (settings.rate_limit, settings.max_concurrent) == (None, None)
    assert settings.quota_uploads is None
    assert (settings.api_keys, settings.cors_origins) == ((), ())


@pytest.mark.parametrize(
    ("memory", "workers", "worker", "query"),
    [
        (80 * GIB, 4, 16 * GIB, 8 * GIB),
        (20 * GIB, 2, 8 * GIB, 4 * GIB),
        (2 * GIB, 8, GIB, GIB // 2),
    ],
)
def test_memory_is_shared_among_workers(
    monkeypatch: pytest.MonkeyPatch, memory: int, workers: int, worker: int, query: int
) -> None:
    monkeypatch.setattr("app.settings.available_memory", lambda: memory)

    settings = Settings(workers=workers)

    assert settings.worker_memory_bytes == worker
    assert settings.query_memory_bytes == query


def test_memory_is_that_of_the_machine_at_most() -> None:
    total = int(Path("/proc/meminfo").read_text().split()[1]) * 1024

    assert GIB <= available_memory() <= total


@pytest.mark.parametrize("name", ["WORKER", "API_KEY", "MAX_FACE"])
def test_unknown_variable_stops_the_start(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(f"GEODESIC_{name}", "2")

    with pytest.raises(
        ValidationError, match=rf"unknown setting GEODESIC_{name}; the settings are"
    ):
        Settings()


def test_variables_of_a_kubernetes_service_stop_the_start_and_are_explained(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("GEODESIC_SERVICE_HOST", "10.0.0.7")
    monkeypatch.setenv("GEODESIC_SERVICE_PORT", "80")
    monkeypatch.setenv("GEODESIC_PORT", "tcp://10.0.0.7:80")

    with pytest.raises(ValidationError, match="enableServiceLinks: false") as refusal:
        Settings()

    assert "GEODESIC_PORT, GEODESIC_SERVICE_HOST, GEODESIC_SERVICE_PORT" in str(refusal.value)


def test_variables_that_the_library_reads_are_no_mistakes(monkeypatch: pytest.MonkeyPatch) -> None:
    sources = (path.read_text() for path in LIBRARY.rglob("*.py") if path.name != "hatch_build.py")
    read = {name for source in sources for name in re.findall(r"GEODESIC_[A-Z_]+", source)}
    assert read == LIBRARY_VARIABLES
    for name in read:
        monkeypatch.setenv(name, "1")
    Settings()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("workers", "0"),
        ("workers", "-1"),
        ("workers", "many"),
        ("max_faces", "5e6"),
        ("max_upload_bytes", "512 MiB"),
        ("worker_memory_bytes", "1000"),
        ("deadline_s", "0"),
        ("deadline_s", "inf"),
        ("deadline_s", "nan"),
        ("rate_limit", "0"),
        ("max_concurrent", "-3"),
        ("quota_uploads", "-1"),
        ("store_evict", "on"),
        ("log_format", "logfmt"),
        ("log_probes", "yes"),
        ("auth", "no"),
        ("api_keys", "secret"),
        ("cors_origins", "example.org"),
        ("cors_origins", "https://example.org/"),
        ("cors_origins", "https://Example.org"),
        ("cors_origins", "https://a.org https://b.org"),
        ("cors_origins", "https://a.org,"),
        ("max_connections", "0"),
        ("trusted_proxies", "*"),
        ("trusted_proxies", "proxy.example"),
        ("allowed_hosts", "https://a.org"),
        ("allowed_hosts", "a.org:8000"),
        ("allowed_hosts", "A.org"),
        ("allowed_hosts", "a.*.org"),
        ("allowed_hosts", "*"),
    ],
)
def test_senseless_value_stops_the_start(
    monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(variable_of(name), value)

    with pytest.raises(ValidationError, match=name):
        Settings()


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (
            {"auth": "off", "api_keys": "alice:0123456789abcdef"},
            "GEODESIC_AUTH is off, but GEODESIC_API_KEYS has keys",
        ),
        (
            {"max_query_bytes": "2000", "max_upload_bytes": "1000"},
            "GEODESIC_MAX_QUERY_BYTES is 2000; it must be at most GEODESIC_MAX_UPLOAD_BYTES, 1000",
        ),
        (
            {"query_memory_bytes": "2000000000", "worker_memory_bytes": "1000000000"},
            "GEODESIC_QUERY_MEMORY_BYTES is 2000000000; it must be at most GEODESIC_WORKER_MEMORY",
        ),
        (
            {"max_caller_connections": "11", "max_connections": "10"},
            "GEODESIC_MAX_CALLER_CONNECTIONS is 11; it must be at most GEODESIC_MAX_CONNECTIONS",
        ),
    ],
)
def test_contradictions_stop_the_start(
    monkeypatch: pytest.MonkeyPatch, given: dict[str, str], why: str
) -> None:
    for name, value in given.items():
        monkeypatch.setenv(variable_of(name), value)

    with pytest.raises(ValidationError, match=why) as refusal:
        Settings()

    assert "0123456789" not in str(refusal.value)


def test_what_is_not_set_follows_what_is() -> None:
    assert Settings(max_upload_bytes=1000).max_query_bytes == 1000
    assert Settings(worker_memory_bytes=GIB).query_memory_bytes == GIB // 2
    assert Settings(max_connections=40).max_caller_connections == 10
    assert Settings(max_connections=1).max_caller_connections == 1


@pytest.mark.parametrize(("descriptors", "connections"), [(200, 100), (1024, 512), (10**6, 1000)])
def test_connections_leave_descriptors_for_files(
    monkeypatch: pytest.MonkeyPatch, descriptors: int, connections: int
) -> None:
    monkeypatch.setattr("app.settings.resource.getrlimit", lambda _: (descriptors, 10**6))
    assert Settings().max_connections == connections

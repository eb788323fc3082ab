"""Ray on this machine: refusals before a process of Ray runs, and what its log means."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from pydantic import SecretStr

from app.engine import ray_node
from app.engine.cluster import ClusterError
from app.engine.ray_node import Processes, host_and_port, joined, running_head
from app.settings import Settings
from tests.support.processes import are_gone
from tests.support.waiting import wait_until

OURS = Settings(cluster_token=SecretStr("a long secret of ours"), address="127.0.0.2:1")


def test_an_address_has_a_host_and_a_port() -> None:
    assert host_and_port("10.0.0.1:6379") == ("10.0.0.1", 6379)
    assert host_and_port("[fd00::1]:6379") == ("fd00::1", 6379)


@pytest.mark.parametrize("address", [None, "", "10.0.0.1", "10.0.0.1:", "x:y", "x:99999999", ":1"])
def test_other_addresses_are_refused(address: str | None) -> None:
    with pytest.raises(ClusterError, match="give --address H:P or set GEODESIC_ADDRESS"):
        host_and_port(address)


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_an_address_that_ray_replaces_is_refused(tmp_path: Path, host: str) -> None:
    with pytest.raises(ClusterError, match=r"127\.0\.0\.2 to try"):
        running_head(host, 6379, tmp_path, OURS).__enter__()


def test_an_address_in_use_is_refused(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.2", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(ClusterError, match=r"cannot listen at .*: Address already in use"):
            running_head("127.0.0.2", port, tmp_path, OURS).__enter__()


def test_without_a_head_there_is_nothing_to_join(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match=r"no head answers at 127\.0\.0\.2:1"):
        joined(tmp_path, OURS).__enter__()


def start(folder: Path, settings: Settings = OURS) -> None:
    ray_node._running([], folder, settings, {}).__enter__()


def test_without_a_token_nothing_starts(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match="set GEODESIC_CLUSTER_TOKEN to a secret"):
        start(tmp_path, Settings())


def test_without_ray_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray_node, "find_spec", lambda _name: None)

    with pytest.raises(ClusterError, match=r"pip install 'geodesic\[cluster\]'"):
        start(tmp_path)


def test_a_folder_with_a_long_path_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ClusterError, match="at most 40 characters"):
        start(tmp_path / (40 * "x"))


VERSIONS = """RuntimeError: Version mismatch: The cluster was started with:
    Ray: 2.59.0
    Python: 3.12.1
This process on Ray at 10.0.0.2 was started with:
    Ray: 2.60.0
    Python: 3.11.7
"""


@pytest.mark.parametrize(
    ("said", "meaning"),
    [
        ("InvalidAuthToken: Authentication token is missing", "has another token"),
        (VERSIONS, r"Ray: 2\.59\.0 Python: 3\.12\.1 This process .* Python: 3\.11\.7$"),
        ("one line\nthe last line\n", "Ray does not start: the last line"),
        ("", "it said nothing"),
    ],
)
def test_the_log_of_a_start_that_fails(tmp_path: Path, said: str, meaning: str) -> None:
    log = tmp_path / "ray.log"
    log.write_text(said)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()

    with pytest.raises(ClusterError, match=meaning):
        Processes(ended, log).wait_until_started("10.0.0.1:6379")


def test_a_start_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As where some other program listens at the address of the head."""
    monkeypatch.setattr(ray_node, "_START_S", 0.0)
    (tmp_path / "ray.log").touch()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as waiting:
        processes = Processes(waiting, tmp_path / "ray.log")
        with pytest.raises(ClusterError, match=r"another program listens at 10\.0\.0\.1:6379"):
            processes.wait_until_started("10.0.0.1:6379")
        processes.stop()


KILLED_LATER = """
import sys
from pathlib import Path
from app.engine import ray_node
from app.settings import Settings

sys.executable = sys.argv[2]
settings = Settings(cluster_token=16 * "x", address="127.0.0.2:1")
with ray_node._running([], Path(sys.argv[1]), settings, {}) as processes:
    print(processes._process.pid, flush=True)
    sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems cannot do that")
def test_processes_of_ray_end_with_a_command_that_is_killed(tmp_path: Path) -> None:
    ray = tmp_path / "ray"
    ray.write_text("#!/bin/sh\necho Ray runtime started\nexec sleep 1000\n")
    ray.chmod(0o755)
    with TemporaryDirectory(prefix="g") as folder:  # of a short path
        command = [sys.executable, "-c", KILLED_LATER, folder, str(ray)]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stdout=pipe) as killed:  # noqa: S603 - ours
            assert killed.stdout is not None
            started = int(killed.stdout.readline())
            killed.kill()
        try:
            wait_until(lambda: are_gone([started]))
        finally:
            with suppress(ProcessLookupError):
                os.kill(started, signal.SIGKILL)


@pytest.mark.slow
def test_one_machine_imports_nothing_for_several(tmp_path: Path) -> None:
    text = (
        "import sys\n"
        "from pathlib import Path\n"
        "import app.cli\n"
        "from app.main import create_app\n"
        "from app.settings import Settings\n"
        "create_app(Settings(store=Path(sys.argv[1])))\n"
        "print(*{'ray', 'msgspec', 'app.engine.distributed'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", text, str(tmp_path)]

    shown = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603
    assert shown.stdout.split() == []

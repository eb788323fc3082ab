"""A cluster whose machines speak TLS answers as ever, and hears nobody without a certificate."""

import socket
import ssl
from collections.abc import Iterator, Mapping
from pathlib import Path

import psutil
import pytest

from tests.support.cluster import ProcessCluster, running_cluster
from tests.support.service import upload_sample
from tests.support.tls import Authority
from tests.support.waiting import LONG_S

pytest.importorskip("ray")
pytestmark = pytest.mark.full

PLAIN = ("Agent", "dashboard.py")
"""What Ray leaves without: the HTTP of its agents, and metrics"""
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\4\0\0\0\0\0"


@pytest.fixture(scope="module")
def variables(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    return Authority(tmp_path_factory.mktemp("tls")).certify("127.0.0.2", "127.0.0.3")


@pytest.fixture(scope="module")
def cluster(
    variables: Mapping[str, str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ProcessCluster]:
    with running_cluster(tmp_path_factory.mktemp("store"), **variables) as cluster:
        cluster.add_node()
        cluster.serve()
        yield cluster


def test_questions_and_jobs_are_answered(cluster: ProcessCluster) -> None:
    client = cluster.servers[0].client
    path = f"/v1/meshes/{upload_sample(client, 'plane', 200)}/distances"  # type: ignore[arg-type]
    question = {"sources": [{"vertex": 0}]}
    answer = client.post(path, json=question)
    assert answer.status_code == 200
    job = client.post(path, json=question, headers={"Prefer": "respond-async"}).headers["location"]
    client.get(f"{job}/events")  # until it has ended
    assert client.get(f"{job}/results").json() == answer.json()


def test_nobody_is_heard_who_has_no_certificate_of_the_authority(
    cluster: ProcessCluster, variables: Mapping[str, str], tmp_path: Path
) -> None:
    machine, nobody, stranger = (
        ssl.create_default_context(cafile=variables["RAY_TLS_CA_CERT"]) for _ in range(3)
    )
    others = Authority(tmp_path).certify("127.0.0.2")
    for context, its in ((machine, variables), (stranger, others)):
        context.load_cert_chain(its["RAY_TLS_SERVER_CERT"], its["RAY_TLS_SERVER_KEY"])
    heard = set()
    for node in (cluster.head, *cluster.nodes):
        for process in node.tree():
            name = f"{process.name()} {' '.join(process.cmdline())}"
            for each in process.net_connections("tcp"):
                if each.status != psutil.CONN_LISTEN:
                    continue
                if is_heard(machine, each.laddr.port):
                    heard.add(process.name())
                    assert not is_heard(nobody, each.laddr.port), name
                    assert not is_heard(stranger, each.laddr.port), name
                else:
                    assert any(text in name for text in PLAIN), name
    assert {"gcs_server", "raylet", "ray::ServeReplica:geodesic:host"} <= heard


def is_heard(context: ssl.SSLContext, port: int) -> bool:
    """Return whether a server says anything by HTTP/2, as gRPC's do."""
    context.set_alpn_protocols(["h2"])
    try:
        with (
            socket.create_connection(("127.0.0.2", port), LONG_S) as connection,
            context.wrap_socket(connection, server_hostname="127.0.0.2") as secure,
        ):
            secure.sendall(GREETING)
            return secure.recv(1) != b""
    except (ssl.SSLError, ConnectionError):
        return False

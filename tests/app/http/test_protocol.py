"""Bytes on a connection: heads without bound, slow ones, broken ones, and too many connections."""

import random
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from app.http import connections, protocol
from app.http.protocol import (
    BYTES_BESIDE_HEADER,
    FREE_CHUNKS,
    LEAST_CHUNK,
    MOST_DRAINED,
    MOST_HEAD_BYTES,
    MOST_PIPELINED,
)
from app.settings import Settings
from tests.support.listening import Listener, listening, read_answer
from tests.support.service import check_problem
from tests.support.waiting import wait_until

LARGEST_READ = 2**18
"""Bytes that event loops read at most at a time"""
START = b"GET /?answer HTTP/1.1\r\nHost: localhost\r\n"
WHOLE = START + b"\r\n"
CHUNKED = b"POST / HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.fixture(scope="module")
def listener(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Listener]:
    with listening(Settings(store=tmp_path_factory.mktemp("store"))) as listener:
        assert is_alive(listener)
        yield listener


def is_alive(listener: Listener) -> bool:
    return listener.get("/?alive").text == "alive"


def ends(connection: socket.socket) -> bool:
    """Wait until the server has closed a connection; what it still sent is not looked at."""
    try:
        while connection.recv(2**16):
            pass
    except ConnectionResetError:
        pass
    return True


# The size of heads

MEGABYTES = 4 * 2**20
ENDLESS = {
    "a header that never ends": START + b"X-B: " + b"a" * MEGABYTES,
    "a name that never ends": START + b"a" * MEGABYTES,
    "many short headers": START + b"a:b\r\n" * (MEGABYTES // 5),
    "an address that never ends": b"GET /" + b"a" * MEGABYTES,
    "an address of megabytes": b"GET /"
    + b"a" * MEGABYTES
    + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "a query of megabytes": b"GET /?" + b"a=1&" * (MEGABYTES // 4) + b" HTTP/1.1\r\n\r\n",
    "trailers that never end": CHUNKED + b"0\r\n" + b"a:b\r\n" * (MEGABYTES // 5),
    "a trailer that never ends": CHUNKED + b"0\r\nX-B: " + b"a" * MEGABYTES,
}


@pytest.mark.parametrize("name", ENDLESS)
def test_a_head_without_end_is_refused(listener: Listener, name: str) -> None:
    listener.parsed_bytes.clear()
    listener.drained_bytes.clear()
    check_problem(listener.send(ENDLESS[name]), 431, "header_too_large")
    assert sum(listener.parsed_bytes) <= MOST_HEAD_BYTES + 2 * LARGEST_READ
    assert sum(listener.drained_bytes) <= MOST_DRAINED + LARGEST_READ
    assert is_alive(listener)


@pytest.mark.parametrize(
    "data",
    [
        b"a" * MEGABYTES,
        b"\r\n" * MEGABYTES,
        START + b"X-B: a\r\n" + b" b\r\n" * MEGABYTES,
        CHUNKED + b"1;" + b"a" * MEGABYTES,
        CHUNKED + b"0" * MEGABYTES,
    ],
    ids=[
        "no method",
        "empty lines",
        "a header of many lines",
        "an extension that never ends",
        "a chunk's size in zeros",
    ],
)
def test_bytes_without_meaning_are_refused(listener: Listener, data: bytes) -> None:
    listener.parsed_bytes.clear()
    assert listener.send(data).json()["code"] in ("malformed_request", "header_too_large")
    assert sum(listener.parsed_bytes) <= MOST_HEAD_BYTES + 2 * LARGEST_READ
    assert is_alive(listener)


@pytest.mark.parametrize("step", [1, 1000, MOST_HEAD_BYTES])
def test_the_largest_head_is_served_and_one_byte_more_is_not(listener: Listener, step: int) -> None:
    headers = len("Hostlocalhost") + len("X") + 2 * BYTES_BESIDE_HEADER
    rest = MOST_HEAD_BYTES - len("/?answer") - headers
    for excess, status in ((0, 200), (1, 431)):
        head = START + b"X: " + b"a" * (rest + excess) + b"\r\n\r\n"
        with listener.connect() as connection:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for begin in range(0, len(head), step):
                connection.sendall(head[begin : begin + step])
            assert read_answer(connection).status_code == status


def test_short_headers_count_as_in_http2(listener: Listener) -> None:
    most = (MOST_HEAD_BYTES - len("/?answer")) // (len("ab") + BYTES_BESIDE_HEADER) - 2
    assert listener.send(START + b"a:b\r\n" * most + b"\r\n").status_code == 200
    check_problem(listener.send(START + b"a:b\r\n" * (most + 3) + b"\r\n"), 431, "header_too_large")


def test_each_head_of_a_connection_is_counted_by_itself(listener: Listener) -> None:
    head = START + b"X: " + b"a" * (MOST_HEAD_BYTES // 2) + b"\r\n\r\n"
    with listener.connect() as connection:
        for _ in range(5):
            connection.sendall(head)
            assert read_answer(connection).text == "answer"


def test_bodies_do_not_count(listener: Listener) -> None:
    body = b"x" * 8 * MOST_HEAD_BYTES
    length = str(len(body)).encode()
    head = b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + length + b"\r\n\r\n"
    assert listener.send(head + body).status_code == 200
    assert listener.bodies[-1] == body
    chunks = (b"%x\r\n%s\r\n" % (LEAST_CHUNK, b"x" * LEAST_CHUNK)) * (len(body) // LEAST_CHUNK)
    assert listener.send(CHUNKED + chunks + b"0\r\n\r\n").status_code == 200
    assert listener.bodies[-1] == body


@pytest.mark.parametrize("excess", [0, 1])
def test_chunks_of_a_few_bytes_are_refused_where_there_are_many(
    listener: Listener, excess: int
) -> None:
    chunks = b"1\r\na\r\n" * (FREE_CHUNKS + excess)
    response = listener.send(CHUNKED + chunks + b"0\r\n\r\n")
    if excess:
        assert check_problem(response, 400, "malformed_request")["limit"] == LEAST_CHUNK
    else:
        assert (response.status_code, listener.bodies[-1]) == (200, b"a" * FREE_CHUNKS)


# Time


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(protocol, "HEAD_S", 0.05)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("begun", [START, b"G", WHOLE + START], ids=["head", "letter", "second"])
def test_a_head_that_is_not_completed_is_refused(listener: Listener, begun: bytes) -> None:
    with listener.connect_at_once(begun) as connection:
        if begun.startswith(WHOLE):
            assert read_answer(connection).text == "answer"
        check_problem(read_answer(connection, listener.port), 504, "deadline_exceeded")
        assert ends(connection)


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("sent", [b"", b"\r\n"], ids=["nothing", "line"])
def test_a_connection_without_a_request_is_closed(listener: Listener, sent: bytes) -> None:
    with listener.connect(sent) as connection:
        assert ends(connection)


@pytest.mark.usefixtures("hasty")
def test_empty_lines_after_an_answer_do_not_hold_a_connection(listener: Listener) -> None:
    with listener.connect_at_once(WHOLE) as connection:
        assert read_answer(connection).text == "answer"
        connection.sendall(b"\r\n")
        assert ends(connection)


@pytest.mark.usefixtures("hasty")
def test_an_answer_under_way_is_not_cut_off(listener: Listener) -> None:
    gate = b"GET /gate?late HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with listener.connect_at_once(gate + START) as connection:
        with listener.connect_at_once(START) as other:  # its time is over after that of the first
            assert read_answer(other).status_code == 504
        listener.open_gate()
        assert read_answer(connection).text == "late"
        assert ends(connection)
    listener.gate.clear()


# The number of requests and connections


def test_pipelined_requests_are_answered_in_order(listener: Listener) -> None:
    requests = [b"GET /?%d HTTP/1.1\r\nHost: localhost\r\n\r\n" % n for n in range(MOST_PIPELINED)]
    with listener.connect(b"".join(requests)) as connection:
        assert [read(connection) for _ in requests] == [str(n) for n in range(MOST_PIPELINED)]


def test_too_many_pipelined_requests_end_the_connection(listener: Listener) -> None:
    gate = b"GET /gate?first HTTP/1.1\r\nHost: localhost\r\n\r\n"
    listener.parsed_bytes.clear()
    with listener.connect(gate + WHOLE * 10_000) as connection:
        wait_until(lambda: listener.parsed_bytes)
        assert is_alive(listener)
        listener.open_gate()
        assert read(connection) == "first"
        assert [read(connection) for _ in range(MOST_PIPELINED)] == ["answer"] * MOST_PIPELINED
        assert ends(connection)
    listener.gate.clear()


def read(connection: socket.socket) -> str:
    """Read one short answer, and nothing of the next."""
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        byte = connection.recv(1)
        assert byte, head
        head += byte
    length = int(head.partition(b"content-length: ")[2].partition(b"\r\n")[0])
    return connection.recv(length, socket.MSG_WAITALL).decode()


@pytest.mark.slow
def test_connections_are_limited_altogether_and_for_each_caller(tmp_path: Path) -> None:
    few = Settings(store=tmp_path, max_connections=3, max_caller_connections=2)
    with listening(few) as listener:
        refused = check_each(listener, 2, 429, "rate_limited")
        assert refused["limit"] == 2
        assert refused["setting"] == "max_caller_connections"
    all_alike = Settings(store=tmp_path, max_connections=3, max_caller_connections=3)
    with listening(all_alike) as listener:
        refused = check_each(listener, 3, 503, "too_many_connections")
        assert refused["setting"] == "max_connections"


def check_each(listener: Listener, limit: int, status: int, code: str) -> dict[str, object]:
    """Fill a server with connections, be refused, and be served once there is room."""
    with ExitStack() as stack:
        held = [stack.enter_context(listener.connect(WHOLE)) for _ in range(limit)]
        assert [read_answer(each).text for each in held] == ["answer"] * limit
        response = listener.send(WHOLE)
        assert response.headers["retry-after"] == "1"
        refused = check_problem(response, status, code)
        wait_until(lambda: len(listener.state.connections) == limit)
        held[0].close()
        wait_until(lambda: len(listener.state.connections) == limit - 1)
        assert is_alive(listener)
    return refused


def test_refusals_do_not_use_up_all_descriptors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "LINGERING", 2)
    monkeypatch.setattr(protocol, "LINGER_S", 1e6)
    few = Settings(store=tmp_path, max_connections=1, max_caller_connections=1)
    with listening(few) as listener, listener.connect(WHOLE) as first, ExitStack() as stack:
        assert read_answer(first).text == "answer"
        for _ in range(2):
            other = stack.enter_context(listener.connect(WHOLE))
            assert read_answer(other).status_code == 503
        for _ in range(20):
            assert ends(stack.enter_context(listener.connect()))
        assert len(listener.state.connections) <= 3


def test_the_log_says_once_that_connections_are_refused(
    tmp_path: Path,
) -> None:
    few = Settings(store=tmp_path, max_connections=1, max_caller_connections=1)
    with (
        capture_logs() as lines,
        listening(few) as listener,
        listener.connect(WHOLE) as first,
    ):
        assert read_answer(first).text == "answer"
        assert [listener.send(WHOLE).status_code for _ in range(3)] == [503] * 3
    (line,) = [line for line in lines if line["event"] == "connections refused"]
    assert "at most 1 are allowed" in line["reason"]
    assert line["caller"] == "127.0.0.1"


# Broken requests

BROKEN = {
    "no request": b"nonsense\r\n\r\n",
    "a bad version": b"GET / HTTP/9.9\r\n\r\n",
    "two lengths": START + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n",
    "a length and chunks": CHUNKED.replace(b"\r\n\r\n", b"\r\nContent-Length: 3\r\n\r\n"),
    "no absolute path": b"CONNECT localhost:80 HTTP/1.1\r\n\r\n",
    "bytes in the path": b"GET /\xff HTTP/1.1\r\n\r\n",
    "a chunk without a size": CHUNKED + b"z\r\n",
    "a negative length": START + b"Content-Length: -1\r\n\r\n",
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_request_is_refused(listener: Listener, name: str) -> None:
    check_problem(listener.send(BROKEN[name]), 400, "malformed_request")
    assert is_alive(listener)


def test_the_answer_before_a_broken_request_comes_first(listener: Listener) -> None:
    gate = b"GET /gate?first HTTP/1.1\r\nHost: localhost\r\n\r\n"
    with listener.connect(gate + b"nonsense\r\n\r\n") as connection:
        assert is_alive(listener)
        listener.open_gate()
        assert read_answer(connection).text == "first"
        assert ends(connection)
    listener.gate.clear()


def test_an_application_that_reads_a_broken_body_is_told(listener: Listener) -> None:
    listener.disconnects.clear()
    chunked = CHUNKED.replace(b"POST /", b"POST /broken")
    with listener.connect(chunked + b"1\r\na\r\n") as connection:
        assert is_alive(listener)
        connection.sendall(b"no size\r\n")
        check_problem(read_answer(connection, listener.port), 400, "malformed_request")
    wait_until(lambda: "/broken" in listener.disconnects)


# Random bytes

PARTS = [
    *(b"GET", b"POST", b" ", b"/", b"/gate", b"?x", b" HTTP/1.1", b" HTTP/1.0", b"\r\n", b"\n"),
    *(b"Host: localhost", b"Content-Length: ", b"Transfer-Encoding: chunked", b"Connection: close"),
    *(b"Expect: 100-continue", b"Upgrade: websocket", b"Connection: upgrade", b"0", b"5", b"a:"),
    *(b"\r\n\r\n", b"\x00", b"\xff\xfe", b"%zz", b"x" * 5000, b"-1", b"18446744073709551616"),
]


def assembled(dice: random.Random) -> bytes:
    return b"".join(dice.choices(PARTS, k=dice.randrange(1, 40)))


def mutated(dice: random.Random) -> bytes:
    data = bytearray(dice.choice([WHOLE, CHUNKED + b"3\r\nabc\r\n0\r\n\r\n", *BROKEN.values()]))
    for _ in range(dice.randrange(1, 6)):
        place = dice.randrange(len(data))
        data[place : place + dice.randrange(3)] = dice.randbytes(dice.randrange(3))
        data = data or bytearray(b"\n")
    return bytes(data)


@pytest.mark.slice(2)
@pytest.mark.parametrize("seed", range(100))
def test_any_bytes_are_answered_or_refused(listener: Listener, seed: int) -> None:
    dice = random.Random(seed)
    listener.open_gate()
    for _ in range(100):
        data = dice.choice([assembled, mutated])(dice)
        with listener.connect(data) as connection:
            connection.shutdown(socket.SHUT_WR)
            received = b""
            try:
                while part := connection.recv(2**16):
                    received += part
            except ConnectionResetError:
                pass
            assert not received or received.startswith(b"HTTP/1.1 "), data
    listener.gate.clear()
    assert is_alive(listener)
    wait_until(lambda: not listener.state.connections)

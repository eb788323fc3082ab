"""The head of an answer and the beginning of its body, in one write."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from app.http.joined_writes import JoinedWrites

HEAD, BODY, REST = b"head ", b"body ", b"rest"


class Recorder:
    """A transport that records what it is asked to do."""

    def __init__(self) -> None:
        self.calls: list[bytes | str] = []
        self.is_closed = False

    def write(self, data: bytes) -> None:
        assert not self.is_closed
        self.calls.append(data)

    def writelines(self, parts: list[bytes]) -> None:
        self.write(b"".join(parts))

    def close(self) -> None:
        self.is_closed = True
        self.calls.append("close")

    def is_closing(self) -> bool:
        return self.is_closed


def calls_of(scene: Callable[[Any, Recorder], Awaitable[None]]) -> list[bytes | str]:
    async def main() -> list[bytes | str]:
        recorder: Any = Recorder()
        await scene(JoinedWrites(recorder, asyncio.get_running_loop()), recorder)
        await asyncio.sleep(0.01)
        return list(recorder.calls)

    return asyncio.run(main())


def test_a_head_and_its_body_are_one_write_and_the_rest_is_not_delayed() -> None:
    async def scene(joined: JoinedWrites, recorder: Recorder) -> None:
        joined.write(HEAD)
        assert recorder.calls == []
        joined.write(BODY)
        joined.write(REST)
        assert recorder.calls == [HEAD + BODY, REST]

    assert calls_of(scene) == [HEAD + BODY, REST]


def test_a_head_whose_body_is_not_there_yet_is_sent_alone() -> None:
    async def scene(joined: JoinedWrites, recorder: Recorder) -> None:
        joined.write(HEAD)
        await asyncio.sleep(0)
        assert recorder.calls == [HEAD]
        joined.write(BODY)

    assert calls_of(scene) == [HEAD, BODY]


def test_an_answer_without_a_body_is_sent_before_the_end() -> None:
    async def scene(joined: JoinedWrites, _recorder: Recorder) -> None:
        joined.write(HEAD)
        joined.close()
        assert joined.is_closing()

    assert calls_of(scene) == [HEAD, "close"]


def test_a_head_is_dropped_where_its_connection_is_closed_meanwhile() -> None:
    async def scene(joined: JoinedWrites, recorder: Recorder) -> None:
        joined.write(HEAD)
        recorder.close()

    assert calls_of(scene) == ["close"]

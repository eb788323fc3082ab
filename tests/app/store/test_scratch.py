"""Scratch: uploads of all callers share one budget, and none takes what others need."""

from pathlib import Path

import anyio
import pytest

from app.errors import ProblemError
from app.store.scratch import Scratch, most_unpacked


def test_uploads_reserve_from_one_budget(tmp_path: Path) -> None:
    """A caller that holds some gets at most half of it; the end of an upload gives all back."""
    scratch = Scratch(tmp_path, 1000)
    scratch.prepare()

    async def run() -> None:
        async with scratch.folder("a") as first, scratch.folder("a") as second:
            first.reserve(400)
            with pytest.raises(ProblemError) as greedy:
                second.reserve(101)
            assert (greedy.value.problem.actual, greedy.value.problem.limit) == (501, 500)
            second.reserve(100)
            async with scratch.folder("b") as other:
                with pytest.raises(ProblemError) as full:
                    other.reserve(501)
                assert (full.value.problem.actual, full.value.problem.limit) == (1001, 1000)
                assert full.value.problem.code == "queue_full"
                other.reserve(500)
                first.reserve(50)
                assert scratch.reserved == 650
        assert scratch.reserved == 0
        assert not list((tmp_path / "tmp").iterdir())

    anyio.run(run)


def test_one_upload_alone_may_have_the_whole_budget(tmp_path: Path) -> None:
    scratch = Scratch(tmp_path, 1000)
    scratch.prepare()

    async def run() -> None:
        async with scratch.folder("a") as folder:
            folder.reserve(1000)
            with pytest.raises(ProblemError):
                folder.reserve(1001)
            assert scratch.reserved == 1000

    anyio.run(run)


@pytest.mark.parametrize(
    ("packed", "most"), [(0, 2**20), (1000, 2**20 + 100_000), (10**7, 5 * 10**8)]
)
def test_a_packed_file_may_grow_a_hundredfold(packed: int, most: int) -> None:
    assert most_unpacked(packed, 5 * 10**8) == most

"""Clients that hang up while the service accepts what they want."""

import asyncio
from pathlib import Path

from app.encoding import NPY
from tests.support.jobs import SlowSubmissions
from tests.support.killed_jobs import CONTEXT, MESH, Store, end_of
from tests.support.service import store_mesh
from tests.support.waiting import LONG_S


def test_a_query_that_becomes_a_job_while_its_client_hangs_up_is_answered(tmp_path: Path) -> None:
    """The work that was begun for the client has been stopped by then: the job begins anew."""
    store = Store(tmp_path, store_mesh(tmp_path, MESH))
    query = store.query(NPY)

    async def main() -> None:
        async with asyncio.timeout(LONG_S), store.service() as (service, _):
            repository = service.jobs._repository = SlowSubmissions(service.database)
            asked = asyncio.create_task(
                service.query_jobs.answer_or_submit(query, CONTEXT, 0.0, "a key", as_file=False)
            )
            await repository.written.wait()
            asked.cancel()
            await asyncio.wait({asked})
            assert asked.cancelled()
            repository.may_say.set()

            job_id = await store.submit(service, NPY, "a key")
            assert (await end_of(service, job_id)).status == "successful"

    asyncio.run(main())

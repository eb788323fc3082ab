"""Jobs for tests."""

from app.jobs.job import Job, JobSpec

SPEC = JobSpec(
    owner=None,
    kind="distances",
    mesh_id="0" * 32,
    media_type="application/json",
    fingerprint="",
    idempotency_key=None,
    request_id="",
)


def new_job(owner: str | None = None) -> Job:
    return Job(spec=SPEC.model_copy(update={"owner": owner}))

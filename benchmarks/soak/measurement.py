"""The soak as a benchmark: a service of its own, for some minutes, and a report."""

from pathlib import Path

from benchmarks.serving import serving_process
from benchmarks.soak.plan import SETTINGS
from benchmarks.soak.reference import WHOLE, make_plan
from benchmarks.soak.report import write_report
from benchmarks.soak.trial import try_out


def run(minutes: float, path: Path) -> str:
    """Soak a service for some minutes; write the report into ``path`` and return it."""
    plan = make_plan(WHOLE)
    with serving_process(**SETTINGS) as (port, service):
        trial = try_out(plan, ("127.0.0.1", port), service, seconds=60 * minutes)
    about = (
        f"{minutes:g} minutes of mixed traffic by Locust, on the same cores: {len(plan.queries)} "
        f"queries of every kind on {len(plan.meshes)} meshes, uploads of {len(plan.variants)} "
        f"others in every file format, conditional requests, jobs that are watched, fetched and "
        f"dismissed, clients that leave, deadlines, wrong requests, and callers beyond their "
        f"limits. Right answers come from the library, computed before. "
        f"{SETTINGS['GEODESIC_WORKERS']} workers and the one for small work; every cache is so "
        f"small that it has to evict (`benchmarks/soak/plan.py`)."
    )
    return write_report(trial, about, path)

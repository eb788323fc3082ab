"""The model as a benchmark: measured, validated, made larger, and told in a report."""

from pathlib import Path

from benchmarks.scaling.figures import measure
from benchmarks.scaling.growth import Growth, Replicas
from benchmarks.scaling.report import write_report
from benchmarks.scaling.traffic import Assumed
from benchmarks.scaling.validation import validate


def run(path: Path) -> str:
    """Measure, validate and simulate; write the report into ``path`` and return it."""
    found, figures = validate(), measure()
    local, *_, ray = found.replicas
    # A beat is a call by Ray, as a question is.
    beat_s = ray.question_s - local.question_s
    replicas = Replicas(local.question_s, ray.question_s, local.stored_s, beat_s)
    return write_report(found, Growth(figures, Assumed(), replicas), path)

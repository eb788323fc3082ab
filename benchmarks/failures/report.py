"""The report of a campaign: a table of failures, and what clients saw."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from benchmarks.failures.trial import Trial
from benchmarks.tables import machine, rated, table

LIMIT_S = 10.0
"""Within which a request gets its answer or refusal"""


ABOUT = (
    "A head, two nodes with one worker each and one for small work, three replicas, an S3 server "
    "(moto) and PostgreSQL, each in a network namespace of its own, on the same cores. Seven users "
    "ask small questions, send jobs and upload meshes; two others ask long questions. Each answer "
    "is compared with that of the library, bit by bit. One thing after the other fails under this "
    "load; a supervisor starts commands again; nothing else is done by hand. The last ones happen "
    "where all machines speak TLS."
)
TIMES = (
    "Times count from the failure; that of a refusal from its request, if that came later. All is "
    "as before when all replicas are ready and know all workers; the time includes that for which "
    "the failure lasts. The last column names other commands that ended by themselves."
)
COLUMNS = (
    "what failed",
    "requests",
    "wrong",
    "refused",
    "slowest refusal, s",
    "slowest small answer, s",
    "promised",
    "lost",
    "recovered after, s",
    "started again",
)


def write_report(trials: Sequence[Trial], path: Path) -> str:
    """Write the report; return its text."""
    requests = sum(len(each.exchanges) for each in trials)
    promises = sum(sum(each.promises.values()) for each in trials)
    seen = [[each.failure.name, _seen(each)] for each in trials]
    text = "\n\n".join(
        [
            "# Failures",
            "Written by `python -m benchmarks failures`.",
            ABOUT,
            f"_{machine()}_",
            f"{requests:,} requests, {promises:,} jobs and meshes that were promised.",
            table(COLUMNS, [_row(each) for each in trials]),
            TIMES,
            "## What clients saw",
            table(["what failed", "refusals"], seen),
            *_faults(trials),
        ]
    )
    path.write_text(text + "\n", encoding="utf-8")
    return text


def _row(trial: Trial) -> list[str]:
    return [
        trial.failure.name,
        f"{len(trial.exchanges):,}",
        rated(len(trial.faults), 0, at_least=False, digits=0),
        str(len(trial.refused)),
        rated(trial.slowest_refusal_s, LIMIT_S, at_least=False),
        f"{trial.slowest_s:.1f}",
        str(sum(trial.promises.values())),
        rated(len(trial.lost), 0, at_least=False, digits=0),
        f"{trial.as_before - trial.begin:.1f}",
        ", ".join(trial.restarts) or "none",
    ]


def _seen(trial: Trial) -> str:
    counts = Counter(each.outcome for each in trial.refused)
    named = (f"{counts[name]} × {_WORDS.get(name, name)}" for name in sorted(counts))
    return ", ".join(named) or "none"


_WORDS = {"0": "connection ended or refused, at the replica that was killed"}


def _faults(trials: Sequence[Trial]) -> list[str]:
    lines = [
        f"- {each.failure.name}: `{fault[:300]}`"
        for each in trials
        for fault in (*each.faults[:10], *each.lost[:10])
    ]
    return ["## What was wrong", "\n".join(lines)] if lines else []

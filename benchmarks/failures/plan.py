"""The load of a trial: the requests of the soak, and long questions that never are the same."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from random import Random

import numpy as np
from numpy.typing import NDArray

import geodesic_core as gc
from benchmarks.soak.plan import Expected, Plan, Request, digest_of
from benchmarks.soak.reference import JSON_BODY, OPERATIONS, Scale, make_plan

SCALE = Scale(
    {"knot": 600, "terrain": 3_000, "sphere": 20_000},
    large_faces=100_000,
    variants=24,
    rounds=2,
)
SOURCES, TARGETS = 12, 8


@dataclass(frozen=True)
class LongQuestion:
    """A matrix of some seconds, whose rows may come in any order."""

    mesh_id: str
    sources: Sequence[int]
    targets: Sequence[int]
    lengths: NDArray[np.float64]
    """(sources, targets): the right answer"""

    def shuffled(self, random: Random) -> Request:
        """Return it in an order in which it was hardly ever asked."""
        order = random.sample(range(len(self.sources)), len(self.sources))
        body = {"sources": [self.sources[k] for k in order], "targets": self.targets}
        answer = BytesIO()
        np.save(answer, self.lengths[order])
        return Request(
            OPERATIONS["matrix"],
            "POST",
            f"/v1/meshes/{self.mesh_id}/matrix?format=npy",
            json.dumps(body).encode(),
            JSON_BODY,
            Expected(digest=digest_of(answer.getvalue())),
        )


@dataclass(frozen=True)
class Load:
    """All that is sent."""

    plan: Plan
    long: LongQuestion


def make_load() -> Load:
    """Return the same load each time, with right answers from the library alone."""
    plan, random = make_plan(SCALE), Random(22)  # noqa: S311 - the same questions in each run
    sphere = gc.samples.sphere(SCALE.large_faces)
    sources, targets = (
        random.sample(range(len(sphere.vertices)), count) for count in (SOURCES, TARGETS)
    )
    lengths = gc.Solver(sphere).distance_matrix(sources, targets)
    return Load(plan, LongQuestion(plan.large, sources, targets, lengths))

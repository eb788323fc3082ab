"""Write the golden cases anew: ``python -m tests.core.golden.make``.

A case is added by hand where a bug was found. The answers are closed forms, or the unfolding
oracle's, which shares no code with geodesic_core; coordinates are stored in full.
"""

import json
import math
from pathlib import Path

import numpy as np

from tests.support import zoo
from tests.support.oracles import closed_forms, unfolding

FOLDER = Path(__file__).parent
TARGETS = 12


def write(name, why, vertices, faces, source, row, answer_from, error=1e-12) -> None:
    """Store a mesh with its distances from the source to a spread of vertices."""
    far = np.argsort(row, kind="stable")
    targets = sorted({int(v) for v in far[np.linspace(0, len(row) - 1, TARGETS).astype(int)]})
    case = {
        "why": why,
        "answers_from": answer_from,
        "relative_error": error,
        "source": int(source),
        "distances": {str(v): float(row[v]) for v in targets},
        "vertices": np.asarray(vertices, dtype=float).tolist(),
        "faces": np.asarray(faces).tolist(),
    }
    lines = ",\n".join(f'  "{key}": {json.dumps(value)}' for key, value in case.items())
    (FOLDER / f"{name}.json").write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def write_unfolded(name, why, vertices, faces, source, error=1e-12) -> None:
    row = unfolding.distance_matrix(vertices, faces)[source]
    write(name, why, vertices, faces, source, row, "enumeration of unfoldings", error)


def spider_and_fly():
    """Dudeney's room: both points are vertices, each wall is a fan around its points."""
    size = np.array((30, 12, 12))
    points = [tuple(size * corner) for corner in np.ndindex(2, 2, 2)]
    points += [(0, 6, 1), (30, 6, 11)]
    walls = [
        [(8, a, b) for a, b in ((0, 1), (1, 3), (3, 2), (2, 0))],
        [(9, b, a) for a, b in ((4, 5), (5, 7), (7, 6), (6, 4))],
        [(0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)],
        [(0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ]
    return np.array(points, dtype=float), np.array([face for wall in walls for face in wall])


def main() -> None:
    vertices, faces = spider_and_fly()
    row = closed_forms.box((30, 12, 12), vertices[8], vertices)
    assert math.isclose(row[9], 40)
    write(
        "spider_and_fly",
        "The shortest way crosses five of the six walls (H. E. Dudeney)",
        vertices, faces, 8, row, "rolling the box",
    )  # fmt: skip
    write_unfolded(
        "icosphere",
        "Ties everywhere: a queue that drops equal keys leaves vertices unreached",
        *zoo.icosphere(2), 12,
    )  # fmt: skip
    vertices, faces = zoo.icosphere(2)
    write_unfolded(
        "crumpled_ball",
        "Saddles at every second vertex, windows that end each other",
        zoo.crumpled(vertices, 0.3, seed=3), faces, 40,
    )  # fmt: skip
    write_unfolded("torus", "Genus 1: two ways around, twice", *zoo.torus(14, 10), 3)
    write_unfolded(
        "bow_ties",
        "Vertices where several fans meet: a walk around a vertex sees one fan only",
        *zoo.voxels([(0, 0, 0), (1, 1, 1), (2, 2, 0), (2, 0, 2), (3, 1, 1)]), 0,
    )  # fmt: skip
    vertices, faces = zoo.grid(12, 10, seed=21, jitter=0.22)
    vertices[:, 2] = np.random.default_rng(21).normal(size=len(vertices))
    cells = [(2, 2), (3, 2), (3, 3), (7, 5), (8, 5), (9, 6), (5, 8), (6, 2)]
    write_unfolded(
        "crags_with_holes",
        "Boundary and saddle pseudosources in each other's shadow",
        *zoo.drop_unused(vertices, zoo.without_cells(faces, 12, cells)), 55,
    )  # fmt: skip
    vertices, faces = zoo.grid(8, 8, seed=22, jitter=0.22)
    vertices = vertices * (1, 1e-5, 1)
    write(
        "slivers",
        "Aspect 1e-5 in the plane, where others err by 1e-6 or return infinity",
        vertices, faces, 40, closed_forms.plane(vertices, 40), "Euclid", 1e-10,
    )  # fmt: skip
    vertices, faces, polar, total = zoo.cone(10, 1.0, zigzag=True, splits=2)
    write(
        "saddle_cone",
        "An apex of more than two full turns: half of all paths lead through it",
        vertices, faces, 7, closed_forms.cone(polar, 7, total), "law of cosines",
    )  # fmt: skip


if __name__ == "__main__":
    main()

"""Matrices of any size that this process computes."""

from dataclasses import asdict

from app.cli.matrix_file import MatrixToWrite, WrittenMatrix
from app.cli.steps import showing


def write_matrix(wanted: MatrixToWrite, threads: int | None) -> WrittenMatrix:
    """Compute a matrix, and write it; the same command goes on where it was stopped."""
    import geodesic_core as gc

    accuracy = dict(wanted.accuracy)
    if "absolute_error" in accuracy:
        accuracy.setdefault("relative_error", None)  # else its default would hold as well
    with showing("Computing the matrix") as step:
        found = gc.write_matrix(
            wanted.mesh,
            wanted.out,
            wanted.sources,
            wanted.targets,
            **accuracy,
            dtype=wanted.dtype,
            max_distance=wanted.max_distance,
            barriers=wanted.barriers,
            threads=threads,
            progress=step.progress,
            cancel=step.cancel,
        )
    continued = min(found.shape) - found.swept
    return WrittenMatrix(found.shape, asdict(found.error_bound), found.sha256, continued)

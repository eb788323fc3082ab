"""Folded surfaces like those of a cortex, with a medial wall and parcels, and files of them."""

from pathlib import Path

import numpy as np
from nibabel.gifti import GiftiDataArray, GiftiImage

import geodesic_core as gc

RADIUS_MM = 40.0


def folded(side: str, faces: int = 320) -> gc.TriangleMesh:
    """Return a ball with folds, whose wall is towards the other side."""
    ball = gc.samples.sphere(faces)
    x, y, z = ball.vertices.T
    folds = 1.0 + 0.15 * np.sin(7.0 * x + 1.0) * np.sin(6.0 * y) * np.sin(5.0 * z + 0.5)
    sign = -1.0 if side == "left" else 1.0
    vertices = RADIUS_MM * folds[:, None] * ball.vertices * [sign, 1.3, 0.9]
    rows = ball.faces if side == "right" else ball.faces[:, ::-1]  # a mirror turns faces over
    # As files of GIFTI have them.
    return gc.TriangleMesh(
        (vertices + np.array([sign * RADIUS_MM, 0.0, 0.0])).astype(np.float32), rows
    )


def is_cortex(mesh: gc.TriangleMesh) -> np.ndarray:
    """Return which vertices are outside of the wall."""
    return np.abs(mesh.vertices[:, 0]) > 0.3 * RADIUS_MM


def parcel_keys(mesh: gc.TriangleMesh, parcels: int = 5) -> np.ndarray:
    """Return the parcel of each vertex, from 1: stripes across the long axis; 0 in the wall."""
    place = mesh.vertices[:, 1].argsort().argsort()
    return np.where(is_cortex(mesh), 1 + place * parcels // len(place), 0)


def write_surface(path: Path, mesh: gc.TriangleMesh, side: str) -> Path:
    """Write a surface whose points tell their hemisphere, as FreeSurfer's converter does."""
    meta = {"AnatomicalStructurePrimary": f"Cortex{side.title()}"}
    points = GiftiDataArray(mesh.vertices.astype(np.float32), "NIFTI_INTENT_POINTSET", meta=meta)
    triangles = GiftiDataArray(mesh.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE")
    GiftiImage(darrays=[points, triangles]).to_filename(path)
    return path

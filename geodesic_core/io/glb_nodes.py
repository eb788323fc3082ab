"""Nodes of a glTF scene: the tree that places its meshes."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_core.errors import InvalidMesh

_MOST_NODES = 100_000
"""Nodes of a scene; beyond, walking them takes longer than reading any mesh."""


def placements(tree: Mapping[str, Any]) -> list[tuple[int, NDArray[np.float64]]]:
    """Return the meshes that a glTF document shows, each as often as its nodes do.

    Parameters
    ----------
    tree
        The glTF document.

    Returns
    -------
    list of tuple
        The number of a mesh, and the (4, 4) matrix that places it, in the order of the scene;
        children come before their parent.

    Raises
    ------
    InvalidMesh
        The nodes form no tree, or are too many.

    Notes
    -----
    O(nodes). trimesh (5.2) takes quadratic time for deep trees, drops parts where the random names
    that it gives them coincide, and ignores the place of a node with a camera.
    """
    nodes, roots = tree.get("nodes", []), _roots(tree)
    children = [child for node in nodes for child in node.get("children", ())]
    children += roots
    if max(len(nodes), len(children)) > _MOST_NODES:
        raise InvalidMesh(
            f"the GLB file has {max(len(nodes), len(children))} nodes; at most {_MOST_NODES} can "
            "be read: join its parts"
        )
    if len(set(children)) < len(children):
        raise InvalidMesh("the GLB file's nodes do not form a tree: a node has two parents")
    return list(_walk(nodes, roots))[::-1]


def _roots(tree: Mapping[str, Any]) -> list[int]:
    scenes = tree.get("scenes", [])
    return list(scenes[tree.get("scene", 0)].get("nodes", [])) if scenes else []


def _walk(nodes: Any, roots: list[int]) -> Iterator[tuple[int, NDArray[np.float64]]]:
    waiting = [(root, np.eye(4)) for root in roots]
    while waiting:
        number, parent = waiting.pop()
        node = nodes[number]
        with np.errstate(invalid="ignore", over="ignore"):  # the mesh refuses what is not finite
            place = parent @ _transform(node)
        if "mesh" in node:
            yield node["mesh"], place
        waiting += [(child, place) for child in node.get("children", [])]


def _transform(node: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the (4, 4) matrix from a node's coordinates to its parent's."""
    from trimesh.transformations import quaternion_matrix

    matrix = np.eye(4)
    if "matrix" in node:
        matrix = np.array(node["matrix"], np.float64).reshape(4, 4).T
    if "translation" in node:
        moved = np.eye(4)
        moved[:3, 3] = node["translation"]
        matrix = matrix @ moved
    if "rotation" in node:
        x, y, z, w = node["rotation"]
        matrix = matrix @ quaternion_matrix([w, x, y, z])  # type: ignore[no-untyped-call]
    if "scale" in node:
        matrix = matrix @ np.diag([*node["scale"], 1.0])
    return matrix

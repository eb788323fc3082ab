"""Parts of a glTF scene: primitives of its meshes, as their nodes show them."""

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.gltf_accessors import Accessors, refuse
from geodesic_core.io.gltf_document import JOINT_SETS
from geodesic_core.io.gltf_nodes import Nodes

_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6
_MOST_PARTS = 100_000
"""Parts that a scene shows; as many take a few seconds"""


class Shape(NamedTuple):
    """What the vertices of a part are made of; parts of equal shapes share them."""

    node: int
    position: int
    targets: tuple[tuple[int, float], ...]
    """Accessors of displacements, with their weights"""
    joints: tuple[tuple[int, int], ...]
    """Accessors of joints and of how they weigh, where the node has a skin"""


class Part(NamedTuple):
    """A primitive that a node shows."""

    shape: Shape
    primitive: Mapping[str, Any]


def count_faces(tree: Mapping[str, Any], nodes: Nodes) -> int:
    """Return the number of triangles that a scene shows.

    Parts may share accessors, and nodes their meshes: a small file can show any number.
    """
    sizes = [
        sum(_count_primitive_faces(tree["accessors"], part) for part in mesh["primitives"])
        for mesh in tree.get("meshes", [])
    ]
    return sum(nodes.instances(node) * sizes[nodes[node]["mesh"]] for node in nodes.shown)


def _count_primitive_faces(accessors: Any, primitive: Mapping[str, Any]) -> int:
    if not _is_surface(primitive):
        return 0
    number = primitive.get("indices", primitive["attributes"]["POSITION"])
    corners: int = accessors[number]["count"]
    return corners // 3 if primitive.get("mode", _TRIANGLES) == _TRIANGLES else max(0, corners - 2)


def _is_surface(primitive: Mapping[str, Any]) -> bool:
    is_filled = primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN)
    return is_filled and "POSITION" in primitive["attributes"]


def shown_parts(tree: Mapping[str, Any], nodes: Nodes) -> tuple[list[Part], int]:
    """Return the parts with triangles, in the order of the file's meshes, and the number of others.

    Refuse too many, and parts that lack what their nodes' skins or weights need.
    """
    meshes = tree.get("meshes", [])
    count = sum(len(meshes[nodes[node]["mesh"]]["primitives"]) for node in nodes.shown)
    if count > _MOST_PARTS:
        raise InvalidMesh(
            f"the glTF document's scene shows {count} parts; at most {_MOST_PARTS} can be read: "
            "join them"
        )
    shown = [
        (nodes[node]["mesh"], number, node)
        for node in nodes.shown
        for number in range(len(meshes[nodes[node]["mesh"]]["primitives"]))
    ]
    parts = []
    for mesh, number, node in sorted(shown, key=itemgetter(0, 1)):
        primitive = meshes[mesh]["primitives"][number]
        if _is_surface(primitive):
            weights = nodes[node].get("weights", meshes[mesh].get("weights", []))
            targets = _targets(primitive.get("targets", []), weights, mesh)
            joints = _joints(primitive["attributes"], node) if "skin" in nodes[node] else ()
            shape = Shape(node, primitive["attributes"]["POSITION"], targets, joints)
            parts.append(Part(shape, primitive))
    return parts, count - len(parts)


def _targets(
    targets: Sequence[Mapping[str, int]], weights: Sequence[float], mesh: int
) -> tuple[tuple[int, float], ...]:
    if any(weights[len(targets) :]):
        raise InvalidMesh(
            f"mesh {mesh} of the glTF document has {len(weights)} weights, but a part of it has "
            f"{len(targets)} targets"
        )
    return tuple(
        (target["POSITION"], weight)
        for target, weight in zip(targets, weights, strict=False)
        if weight != 0.0 and "POSITION" in target
    )


def _joints(attributes: Mapping[str, int], node: int) -> tuple[tuple[int, int], ...]:
    names = [(f"JOINTS_{i}", f"WEIGHTS_{i}") for i in JOINT_SETS if f"JOINTS_{i}" in attributes]
    if not names or any(weights not in attributes for _, weights in names):
        raise InvalidMesh(
            f"node {node} of the glTF document has a skin, but a part of its mesh lacks JOINTS_0 "
            "or WEIGHTS"
        )
    return tuple((attributes[joints], attributes[weights]) for joints, weights in names)


def placed_positions(
    shape: Shape, nodes: Nodes, accessors: Accessors
) -> tuple[Floats, NDArray[np.bool_]]:
    """Return where the scene shows the n vertices of a shape, and which instances are mirrored.

    The positions have the shape (instances, n, 3).
    """
    points = accessors.floats(shape.position, "VEC3", "positions")
    for number, weight in shape.targets:
        moves = accessors.floats(number, "VEC3", "displacements")
        _check_length(number, moves, points)
        points += weight * moves
    if shape.joints:
        matrices = nodes.joints(nodes[shape.node]["skin"])
        moved = _skinned(points, shape, matrices, accessors)
        return moved[None], np.array([np.linalg.det(matrices[:, :3, :3]).mean() < 0.0])
    matrices = nodes.places(shape.node)
    moved = points @ matrices[:, :3, :3].transpose(0, 2, 1) + matrices[:, None, :3, 3]
    return moved, np.linalg.det(matrices[:, :3, :3]) < 0.0


def _skinned(points: Floats, shape: Shape, matrices: Floats, accessors: Accessors) -> Floats:
    """Return the points as their joints move them: the mean by weight of where each would."""
    moved, total = np.zeros_like(points), np.zeros((len(points), 1))
    for joints, weights in shape.joints:
        numbers = accessors.integers(joints, "VEC4", "joints")
        shares = accessors.floats(weights, "VEC4", "weights of joints")
        _check_length(joints, numbers, points)
        _check_length(weights, shares, points)
        numbers = np.where(shares != 0.0, numbers, 0)  # elsewhere the number means nothing
        if numbers.max() >= len(matrices):
            refuse(joints, f"it names joint {numbers.max()} of a skin of {len(matrices)}")
        for number, share in zip(numbers.T, shares.T[:, :, None], strict=True):
            matrix = matrices[number]
            moved += share * ((matrix[:, :3, :3] @ points[:, :, None])[:, :, 0] + matrix[:, :3, 3])
            total += share
    if not total.all():
        element = np.argmin(total != 0.0)
        refuse(shape.joints[0][1], f"the weights of element {element} are 0: no joint holds it")
    return moved / total


def _check_length(number: int, elements: NDArray[Any], points: Floats) -> None:
    if len(elements) != len(points):
        refuse(number, f"it has {len(elements)} elements for {len(points)} positions")


def triangles(primitive: Mapping[str, Any], accessors: Accessors) -> NDArray[np.integer[Any]]:
    """Return the corners of a part's triangles, (faces, 3), numbered within its positions."""
    number = primitive.get("indices", primitive["attributes"]["POSITION"])
    corners: NDArray[np.integer[Any]]
    if "indices" in primitive:
        corners = accessors.integers(number, "SCALAR", "indices")[:, 0]
    else:
        corners = np.arange(accessors.count(number))
    first = np.arange(max(0, len(corners) - 2))
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLE_STRIP:
        odd = first % 2  # every other triangle is turned round
        return corners[np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)]
    if mode == _TRIANGLE_FAN:
        return corners[np.stack([first + 1, first + 2, np.zeros_like(first)], axis=1)]
    if len(corners) % 3:
        refuse(number, f"its {len(corners)} corners do not form triangles")
    return corners.reshape(-1, 3)

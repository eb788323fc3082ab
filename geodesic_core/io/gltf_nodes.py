"""Nodes of a glTF scene: the tree that places its meshes, their instances and their joints."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from geodesic_core.arrays import Floats
from geodesic_core.errors import InvalidMesh
from geodesic_core.io.gltf_accessors import Accessors

_MOST_NODES = 100_000
"""Nodes of a scene; beyond, walking them takes longer than reading any mesh."""
_AT_REST = {"translation": (0, 0, 0), "rotation": (0, 0, 0, 1), "scale": (1, 1, 1)}
_INSTANCING = "EXT_mesh_gpu_instancing"
_SHAPES = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
"""Attributes of instances, in the order of `_matrices`, and their types"""


class Nodes:
    """Nodes of a checked document, which must form a tree; accessors have instances and skins."""

    def __init__(self, tree: Mapping[str, Any], accessors: Accessors) -> None:
        self._tree = tree
        self._nodes = tree.get("nodes", [])
        self._accessors = accessors
        scenes = tree.get("scenes", [])
        self._roots = list(scenes[tree.get("scene", 0)].get("nodes", [])) if scenes else []
        self._children = {child for node in self._nodes for child in node.get("children", ())}
        pointed_to = len(self._roots) + sum(len(node.get("children", ())) for node in self._nodes)
        most = max(len(self._nodes), pointed_to)
        if most > _MOST_NODES:
            raise InvalidMesh(
                f"the glTF document has {most} nodes; at most {_MOST_NODES} can be read: join its "
                "parts"
            )
        if len(self._children.union(self._roots)) < pointed_to:
            raise InvalidMesh(
                "the glTF document's nodes do not form a tree: a node has two parents"
            )

    def __getitem__(self, node: int) -> Mapping[str, Any]:
        content: Mapping[str, Any] = self._nodes[node]
        return content

    @cached_property
    def shown(self) -> list[int]:
        """Nodes by which the scene shows meshes, in its order; children come before parents."""
        walked, waiting = [], list(self._roots)
        while waiting:
            number = waiting.pop()
            extensions = self[number].get("extensions", {})
            if extensions.get("KHR_node_visibility", {}).get("visible", True):
                walked.append(number)
                waiting += self[number].get("children", ())
        return [number for number in reversed(walked) if "mesh" in self[number]]

    def instances(self, node: int) -> int:
        """Return how often a node shows its mesh."""
        attributes = self._instancing(node)
        if attributes is None:
            return 1
        counts = {self._accessors.count(attributes[kind]) for kind in attributes.keys() & _SHAPES}
        if len(counts) != 1 or "skin" in self[node]:
            raise InvalidMesh(
                f"the instances of node {node} of the glTF document must have places, as many of "
                "each kind, and no skin"
            )
        return counts.pop()

    def places(self, node: int) -> Floats:
        """Return the matrices that place a node's mesh in the scene, (instances, 4, 4)."""
        place = self._places[node][None]
        attributes = self._instancing(node)
        if attributes is None:
            return place
        parts = (
            self._accessors.floats(attributes[kind], shape, f"{kind} of instances")
            if kind in attributes
            else np.array([_AT_REST[kind.lower()]], np.float64)
            for kind, shape in _SHAPES.items()
        )
        return place @ _matrices(*parts)

    def _instancing(self, node: int) -> Mapping[str, int] | None:
        """Return the accessors of a node's instances by their kind; None if it has none."""
        extensions = self[node].get("extensions", {})
        attributes: Mapping[str, int] | None = extensions.get(_INSTANCING, {}).get("attributes")
        return attributes

    def joints(self, skin: int) -> Floats:
        """Return the matrices by which the joints of a skin move positions, (joints, 4, 4)."""
        content = self._tree["skins"][skin]
        joints = np.array([self._places[joint] for joint in content["joints"]]).reshape(-1, 4, 4)
        if "inverseBindMatrices" not in content:
            return joints
        number = content["inverseBindMatrices"]
        columns = self._accessors.floats(number, "MAT4", "inverseBindMatrices")
        if len(columns) < len(joints):
            raise InvalidMesh(
                f"skin {skin} of the glTF document has {len(joints)} joints, but {len(columns)} "
                "inverseBindMatrices"
            )
        bound = columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
        return joints @ bound

    @cached_property
    def _places(self) -> Mapping[int, Floats]:
        """The (4, 4) matrix of each node, from its coordinates to the scene's."""
        moved = [i for i, node in enumerate(self._nodes) if node.keys() & {"matrix", *_AT_REST}]
        transforms = dict(zip(moved, _transforms([self[i] for i in moved]), strict=True))
        places: dict[int, Floats] = {}
        tops = [number for number in range(len(self._nodes)) if number not in self._children]
        waiting = [(number, np.eye(4)) for number in tops]
        while waiting:
            number, place = waiting.pop()
            if number in transforms:
                place = place @ transforms[number]
            places[number] = place
            waiting += [(child, place) for child in self[number].get("children", ())]
        if len(places) < len(self._nodes):
            raise InvalidMesh("the glTF document's nodes do not form a tree: some go in circles")
        return places


def _transforms(nodes: Sequence[Mapping[str, Any]]) -> Floats:
    """Return the matrices from the coordinates of nodes to those of their parents, (n, 4, 4)."""
    matrices = _matrices(
        *(
            np.array([node.get(name, rest) for node in nodes], np.float64).reshape(-1, len(rest))
            for name, rest in _AT_REST.items()
        )
    )
    for matrix, node in zip(matrices, nodes, strict=True):
        if "matrix" in node:
            matrix[:] = np.reshape(node["matrix"], (4, 4)).T
    return matrices


def _matrices(translation: Floats, rotation: Floats, scale: Floats) -> Floats:
    """Return the matrices (n, 4, 4) that scale, then rotate by unit quaternions, then translate.

    Each argument has n rows, or one. A quaternion of zeros does not rotate, as in most programs.
    """
    x, y, z, w = rotation.T
    length = x * x + y * y + z * z + w * w
    s = np.divide(2.0, length, out=np.zeros_like(length), where=length != 0.0)
    turn = np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    count = max(len(translation), len(rotation), len(scale))
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = turn * scale[:, None, :]
    matrices[:, :3, 3] = translation
    return matrices

"""Uploads, and the reports of meshes."""

from typing import Annotated, Any, Literal, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic_core import PydanticCustomError

from app.schemas.points import LARGEST_COUNT, StrictModel


def _way_of_merging(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Tell of one fault where pydantic finds one for each kind of value."""
    try:
        return check(value)
    except ValidationError:
        raise PydanticCustomError(
            "merge", "Input should be 'none', 'exact' or a distance, 0 or more"
        ) from None


Merge = Annotated[
    Literal["none", "exact"] | Annotated[float, Field(ge=0, allow_inf_nan=False)],
    WrapValidator(_way_of_merging),
]
_MeshFormat = Literal[
    "obj",
    "off",
    "ply",
    "stl",
    "glb",
    "gltf",
    "gii",
    "freesurfer",
    "vtk",
    "vtp",
    "vtu",
    "vts",
    "vtr",
    "vti",
    "asc",
    "npz",
]
MESH_FORMATS: tuple[str, ...] = get_args(_MeshFormat)
MeshFormat = Annotated[
    _MeshFormat, BeforeValidator(lambda name: name.lower() if isinstance(name, str) else name)
]
"""Types of files that `geodesic_core.load_mesh` reads, in any case"""
LONGEST_NAME = 255
"""Characters of the name of a mesh: as many as file systems allow for that of a file"""
MeshName = Annotated[str, Field(max_length=LONGEST_NAME, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
"""Without control characters, which a terminal would obey"""
SampleName = Literal["knot", "sphere", "terrain", "cortex", "obstacles", "plane"]


class UploadParameters(StrictModel):
    """Options for reading the mesh of an upload, or the sample to make."""

    name: MeshName | None = Field(
        default=None,
        description="Name for people; if not given, the file name in a form, or the name of the "
        "sample",
    )
    format: MeshFormat | None = Field(
        default=None,
        description="Format of the file. By default, `Content-Type` tells it, else the suffix of "
        "its name in the form or in `Content-Disposition`, else its first bytes",
    )
    merge: Merge = Field(
        default="none",
        description="`exact` joins vertices at the same position; a distance in mesh units joins "
        "those no farther apart, and so all that steps of this length lead to, from vertex to "
        "vertex",
    )
    sample: SampleName | None = Field(
        default=None, description="The sample to make, instead of reading a mesh"
    )
    faces: Annotated[int, Field(ge=1, le=LARGEST_COUNT)] | None = Field(
        default=None, description="Approximate number of faces of the sample; 20000 if not given"
    )


class ListParameters(StrictModel):
    """The part of a list to answer with."""

    limit: int = Field(default=50, ge=1, le=1000)
    cursor: str | None = Field(default=None, description="`next_cursor` of the previous part")


class MeshListParameters(ListParameters):
    """The part of a list of meshes to answer with."""

    name: MeshName | None = Field(default=None, description="Only meshes of this name")


class Sample(BaseModel):
    """Number of elements of a kind, and the ids of the first ten; an edge has two."""

    count: int
    ids: list[int | tuple[int, int]]


class MeshDocument(BaseModel):
    """The report of a mesh in the store."""

    id: str
    name: str | None = Field(description="The name given with its first upload, if any")
    vertices: int
    faces: int = Field(description="Number of all faces, including those that repeat a vertex")
    warnings: list[str] = Field(
        description="Warnings of one or two sentences each, with the remedy"
    )
    created: str = Field(description="When the mesh was stored, RFC 3339")
    cut_from: str | None = Field(
        default=None,
        description="For a mesh that was cut along curves: the mesh that it was cut from, which "
        "its arrays lead back to; see `CutAnswer`",
    )
    arrays: dict[str, str] = Field(
        description="Paths of its arrays, by name: `lengths` where those of its edges were given, "
        "and no `vertices` without positions"
    )
    edges: int
    triangulated_polygons: int = Field(
        description="Polygons that became several faces; the array `face_map` leads back to them"
    )
    components: int
    component_vertices: Sample = Field(description="The lowest vertex of each component")
    boundary_loops: int
    euler_characteristic: int
    saddle_vertices: int
    boundary_vertices: int
    bow_tie_vertices: Sample = Field(description="Vertices where several fans of faces meet")
    isolated_vertices: Sample = Field(description="Vertices that belong to no face of the surface")
    duplicate_vertices: Sample = Field(
        description="Vertices at the position of an earlier vertex; `merge=exact` joins them"
    )
    near_vertices: Sample | None = Field(
        default=None,
        description="Pairs of border vertices that are nearly joined: a thousand times as far "
        "apart over the surface; `merge` takes a distance, which joins them. Null, as the next "
        "three, for a mesh that was stored by a release without them",
    )
    near_distance: float | None = Field(
        default=None,
        description="Largest distance between the vertices of such a pair; 0 without any",
    )
    t_junctions: Sample | None = Field(
        default=None,
        description="Border vertices that lie on a border edge of which they are no end",
    )
    t_junction_edges: Sample | None = Field(
        default=None, description="The edge that each of them lies on, in the same order"
    )
    repeated_vertex_faces: Sample = Field(
        description="Faces with fewer than three different vertices; they are not part of the "
        "surface"
    )
    zero_length_edges: Sample = Field(
        description="Edges between different vertices at the same position: their ends are one "
        "point"
    )
    collapsed_faces: Sample = Field(
        description="Faces with an edge of zero length: they shrink to an edge of other faces, or "
        "to a vertex"
    )
    duplicate_faces: Sample = Field(
        description="Faces with the same three vertices as an earlier face"
    )
    degenerate_faces: Sample = Field(description="Faces of the surface without area")
    non_manifold_edges: Sample
    inconsistent_orientation: bool
    misoriented_edges: Sample
    bounds: tuple[tuple[float, float, float], tuple[float, float, float]] | None = Field(
        description="Lowest and highest corner of the bounding box; null for a mesh that is given "
        "by the lengths of its edges alone"
    )
    mean_edge_length: float


class ListedMesh(BaseModel):
    """A mesh in a list; its own address has the whole report."""

    id: str
    name: str | None = Field(description="The name given with its first upload, if any")
    vertices: int
    faces: int
    created: str = Field(description="When the mesh was stored, RFC 3339")


class MeshList(BaseModel):
    """A part of the meshes in the store, the newest first."""

    meshes: list[ListedMesh]
    next_cursor: str | None = None

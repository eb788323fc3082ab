"""Files of surfaces, one for each hemisphere: GIFTI and FreeSurfer's."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from geodesic_core.brain.cortex import Cortex
from geodesic_core.brain.files import kind_of, nibabel
from geodesic_core.brain.gifti import write_gifti
from geodesic_core.brain.structures import STRUCTURE, Side, only
from geodesic_core.errors import InvalidArgument

_GIFTI = ".surf.gii"
_FREESURFER = (".white", ".pial", ".midthickness", ".orig", ".smoothwm", ".inflated", ".sphere")


def write_surfaces(paths: str | Path | Mapping[Side, str | Path], cortex: Cortex) -> None:
    """Write the surfaces of a cortex, as `load_cortex` reads them.

    Parameters
    ----------
    paths
        A path for each side that is to be written, ``{"left": "lh.surf.gii"}``; or the one of a
        single hemisphere. Names end in ``.surf.gii``, a file that tells its side; or, as those of
        FreeSurfer, which tell it by ``lh.`` or ``rh.``, in ``.white``, ``.pial``,
        ``.midthickness``, ``.orig``, ``.smoothwm``, ``.inflated`` or ``.sphere``.
    cortex
        From `load_cortex`, which takes any mesh: ``load_cortex({"left": mesh})``. Its positions are
        float32 in the file; vertices and faces keep their numbers. The region and corrected areas
        are for `write_labels` and `write_maps`.

    Raises
    ------
    InvalidArgument
        A name ends otherwise; there is one path for two hemispheres; the cortex has no such side.
        Then no file is written.
    NotEmbedded
        The mesh is given by lengths alone.
    MissingExtra
        It needs nibabel, the extra ``brain``.

    Notes
    -----
    O(V + F).

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> cortex = gc.brain.load_cortex({"right": gc.samples.sphere(80)})
    >>> file = f"{mkdtemp()}/ball.surf.gii"
    >>> gc.brain.write_surfaces(file, cortex)
    >>> gc.brain.load_cortex(file).structures
    (Structure(side='right', first=0, count=42, faces=80),)
    """
    if not isinstance(paths, Mapping):
        paths = {only(cortex.structures, paths, "give {'left': …, 'right': …}").side: paths}
    mesh, structures = cortex.mesh, {each.side: each for each in cortex.structures}
    missing = [side for side in paths if side not in structures]
    if missing:
        raise InvalidArgument(f"there is no {missing[0]} surface, only {' and '.join(structures)}")
    mesh.require_positions("write_surfaces")
    kinds = {side: kind_of(Path(path), (_GIFTI, *_FREESURFER)) for side, path in paths.items()}
    for side, path in paths.items():
        structure = structures[side]
        points = mesh.vertices[structure.part].astype(np.float32)
        triangles = structure.of(mesh.faces).reshape(-1, 3).astype(np.int32)
        if kinds[side] == _GIFTI:
            meta = {STRUCTURE: structure.name}  # Workbench looks for it here
            arrays = [
                (points, "NIFTI_INTENT_POINTSET", meta),
                (triangles, "NIFTI_INTENT_TRIANGLE", {}),
            ]
            write_gifti(Path(path), structure, arrays)
        else:
            write = nibabel("freesurfer", "write_surfaces").write_geometry
            write(path, points, triangles, "geodesic-core")

"""Cortical surfaces: the files of brain imaging, and its words for what this library computes.

Files are read and written by nibabel, the extra ``brain``. Distances are in mm where surfaces are.
"""

from geodesic_core.brain.cifti import BrainMatrix, load_matrix
from geodesic_core.brain.cortex import Cortex, load_cortex
from geodesic_core.brain.distances import write_distances
from geodesic_core.brain.map_files import load_maps, write_labels, write_maps
from geodesic_core.brain.parcellation import Parcellation, load_parcels
from geodesic_core.brain.parcels import ParcelDistances, parcel_distances
from geodesic_core.brain.smoothing import smooth
from geodesic_core.brain.surface_files import write_surfaces

__all__ = [
    "BrainMatrix",
    "Cortex",
    "ParcelDistances",
    "Parcellation",
    "load_cortex",
    "load_maps",
    "load_matrix",
    "load_parcels",
    "parcel_distances",
    "smooth",
    "write_distances",
    "write_labels",
    "write_maps",
    "write_surfaces",
]

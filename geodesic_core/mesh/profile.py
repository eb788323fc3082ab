"""Profiles of curves: how high they are, and how steep, along their way over the map."""

from dataclasses import dataclass

import numpy as np

from geodesic_core.arrays import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Profile:
    """Heights along a curve, by the distance on the map, as beside a walk in a guide.

    Examples
    --------
    >>> roof = gc.TriangleMesh([[0, 0, 0], [0, 2, 0], [4, 1, 3], [8, 1, 1]], [[0, 2, 1], [2, 3, 1]])
    >>> profile = roof.curve([0, 2, 3]).profile()
    >>> profile
    Profile(8.12311 on the map, 3 up, 2 down)
    >>> profile.slopes.round(2).tolist()
    [0.73, -0.5]
    """

    chainage: Floats
    """(K,) float64: distance from the start on the map, mesh units. A closed curve ends where it
    begins."""
    heights: Floats
    """(K,) float64, mesh units"""

    @property
    def slopes(self) -> Floats:
        """(K - 1,) float64: what each segment rises by its length on the map; infinite upright."""
        run, rise = np.diff(self.chainage), np.diff(self.heights)
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes: Floats = np.where(rise == 0.0, 0.0, rise / run)
        return slopes

    @property
    def ascent(self) -> float:
        """All that goes up, mesh units."""
        return float(np.diff(self.heights).clip(min=0.0).sum())

    @property
    def descent(self) -> float:
        """All that goes down, mesh units, 0 or more."""
        return float(-np.diff(self.heights).clip(max=0.0).sum())

    def __repr__(self) -> str:
        return (
            f"Profile({self.chainage[-1]:.6g} on the map, {self.ascent:.6g} up, "
            f"{self.descent:.6g} down)"
        )


def profile_of(points: Floats) -> Profile:
    """Return the profile of points (K, 3), heights along z."""
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    return Profile(np.concatenate([[0.0], np.cumsum(steps)]), points[:, 2].copy())

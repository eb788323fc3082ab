"""Noise on the plane, by arithmetic alone: the same to the bit on every machine."""

import numpy as np

from geodesic_core.arrays import Floats, Longs


def noise(x: Floats, y: Floats, seed: int) -> Floats:
    """Return gradient noise: smooth, 0 at the points of the unit lattice, within ±1."""
    left, below = np.floor(x), np.floor(y)
    u, v = x - left, y - below
    corners = []
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        bits = hashed(left.astype(np.int64) + dx, below.astype(np.int64) + dy, seed)
        slope_x, slope_y = (bits & 0xFFFF) / 32768.0 - 1.0, (bits >> 16 & 0xFFFF) / 32768.0 - 1.0
        corners.append(slope_x * (u - dx) + slope_y * (v - dy))
    s, t = (w * w * w * (w * (6.0 * w - 15.0) + 10.0) for w in (u, v))
    lower = corners[0] + s * (corners[1] - corners[0])
    upper = corners[2] + s * (corners[3] - corners[2])
    found: Floats = lower + t * (upper - lower)
    return found


def hashed(i: Longs, j: Longs, seed: int) -> Longs:
    """Return 32 bits that look random for each point of a lattice."""
    mixed = i * 0x9E3779B1 + j * 0x85EBCA77 + seed * 0xC2B2AE3D
    for _ in range(2):
        mixed = (mixed ^ (mixed >> 15 & 0x1FFFF)) * 0x2C1B3C6D & 0xFFFFFFFF
    return mixed ^ mixed >> 16

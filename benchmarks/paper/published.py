"""Numbers of the paper: its Tables 1 and 2, and those of its Figures 6, 7 and 12."""

from typing import NamedTuple


class Model(NamedTuple):
    """A row of Table 1; times in seconds of a Pentium M at 1.6 GHz, errors in per cent."""

    faces: int
    exact_s: float
    exact_wpe: float
    approximate_s: float
    approximate_wpe: float
    approximate_max: float
    approximate_mean: float
    marching_s: float
    marching_max: float
    marching_mean: float


TABLE_1 = {
    "Rockerarm": Model(80_354, 18.24, 19.74, 1.92, 1.32, 0.06, 0.04, 3.35, 0.63, 0.84),
    "Horse": Model(96_956, 18.43, 18.41, 2.44, 1.40, 0.08, 0.05, 3.45, 1.44, 0.75),
    "Dragon": Model(100_000, 6.45, 7.18, 3.53, 1.85, 0.09, 0.07, 5.81, 1.09, 1.20),
    "Buddha S": Model(30_000, 1.03, 4.57, 0.97, 1.95, 0.14, 0.08, 1.23, 2.15, 2.59),
    "Fandisk U": Model(9_926, 0.78, 10.72, 0.14, 1.01, 0.05, 0.03, 0.21, 1.21, 1.41),
}

SPHERE_EXACT = {
    1: (0.30170, 0.05197),
    2: (0.08052, 0.01760),
    3: (0.02020, 0.00506),
    4: (0.00499, 0.00133),
    5: (0.00125, 0.00034),
    6: (0.00031, 0.00009),
    7: (0.00008, 0.00002),
}
"""Figure 12: largest absolute and mean relative error by level"""
SPHERE_MERGED = {
    1: (0.30170, 0.05197),
    2: (0.08052, 0.01760),
    3: (0.02796, 0.00552),
    4: (0.00959, 0.00213),
    5: (0.00333, 0.00071),
    6: (0.00117, 0.00027),
    7: (0.00041, 0.00009),
}
"""The same with 1.5 windows per edge"""
SPHERE_MARCHING = {
    1: (0.266, 0.030),
    2: (0.127, 0.030),
    3: (0.067, 0.027),
    4: (0.044, 0.019),
    5: (0.027, 0.012),
    6: (0.015, 0.007),
    7: (0.008, 0.004),
}

RATES = {
    1.0: {2: (0.94, 1.25), 3: (0.94, 1.22), 4: (0.90, 1.15), 5: (0.89, 1.10), 6: (0.89, 1.07)},
    1.5: {3: (1.53, 1.67), 4: (1.54, 1.38), 5: (1.52, 1.58), 6: (1.51, 1.40)},
    2.0: {4: (1.65, 1.81), 5: (1.87, 1.82), 6: (1.84, 1.64)},
    2.5: {5: (1.85, 1.88), 6: (1.90, 1.86)},
}
"""Table 2: convergence of the largest and the mean error, by windows per edge and level"""
RATES[1.0][7], RATES[1.5][7] = (0.89, 1.00), (1.50, 1.53)
RATES[2.0][7], RATES[2.5][7] = (1.81, 1.79), (1.90, 1.85)
EXACT_RATES = {
    2: (1.91, 1.56),
    3: (1.99, 1.80),
    4: (2.02, 1.92),
    5: (2.00, 1.97),
    6: (2.00, 1.98),
    7: (1.99, 1.98),
}


class Subdivided(NamedTuple):
    """A row of Figure 6."""

    seconds: float
    faces: int
    windows: int
    wpe: float
    exponent: float | None


FIGURE_6 = {
    "Eight": {
        1: Subdivided(0.055, 1_536, 11_859, 5.15, None),
        2: Subdivided(0.453, 6_144, 90_986, 9.87, 1.47),
        3: Subdivided(4.256, 24_576, 705_032, 19.13, 1.48),
        4: Subdivided(56.103, 98_304, 5_383_796, 36.51, 1.47),
    },
    "Sphere": {
        1: Subdivided(0.000, 32, 54, 1.13, None),
        2: Subdivided(0.002, 128, 310, 1.62, 1.26),
        3: Subdivided(0.011, 512, 2_362, 3.08, 1.46),
        4: Subdivided(0.087, 2_048, 17_418, 5.67, 1.44),
        5: Subdivided(0.677, 8_192, 132_116, 10.75, 1.46),
        6: Subdivided(5.650, 32_768, 997_608, 20.30, 1.46),
        7: Subdivided(77.320, 131_072, 8_022_292, 40.80, 1.50),
    },
    "Convex": {
        1: Subdivided(0.000, 16, 28, 1.00, None),
        2: Subdivided(0.000, 64, 116, 1.12, 1.03),
        3: Subdivided(0.003, 256, 692, 1.73, 1.29),
        4: Subdivided(0.023, 1_024, 5_094, 3.25, 1.44),
        5: Subdivided(0.199, 4_096, 39_996, 6.44, 1.49),
        6: Subdivided(1.778, 16_384, 318_113, 12.88, 1.50),
        7: Subdivided(19.971, 65_536, 2_564_209, 26.02, 1.51),
    },
    "Saddle": {
        1: Subdivided(0.000, 16, 36, 1.29, None),
        2: Subdivided(0.001, 64, 216, 2.08, 1.29),
        3: Subdivided(0.007, 256, 1_520, 3.80, 1.41),
        4: Subdivided(0.054, 1_024, 11_448, 7.30, 1.46),
        5: Subdivided(0.453, 4_096, 87_194, 14.05, 1.46),
        6: Subdivided(4.209, 16_384, 663_782, 26.87, 1.46),
        7: Subdivided(51.007, 65_536, 5_062_828, 51.37, 1.47),
    },
}

FIGURE_7 = {
    0.0: (5.16, 20.6),
    0.1: (3.67, 15.1),
    0.2: (2.52, 10.7),
    0.4: (1.48, 6.4),
    0.8: (0.81, 3.5),
}
"""Seconds and windows per edge by noise, a share of the mean length of edges"""

"""Smoothing: mass and constants stay, and a peak becomes a Gaussian."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_core as gc


@pytest.mark.jit
def test_mass_and_constants_stay_and_nothing_crosses_a_wall_that_blocks(surfaces, masks):
    cortex = gc.brain.load_cortex(surfaces, masks, "blocks")
    rng = np.random.default_rng(5)
    values = np.stack([rng.normal(size=len(cortex.areas)), np.full(len(cortex.areas), 3.0)])
    values[:, 0] = np.nan if 0 not in cortex.region else values[:, 0]
    smoothed = gc.brain.smooth(cortex, values, fwhm=20.0)
    areas = cortex.areas[cortex.region]
    inside = values[:, cortex.region]
    assert_allclose(smoothed[:, cortex.region] @ areas, inside @ areas, rtol=1e-12)
    assert_allclose(smoothed[1, cortex.region], 3.0, rtol=1e-6)
    assert smoothed[0, cortex.region].std() < 0.7 * inside[0].std()
    outside = np.setdiff1d(np.arange(len(cortex.areas)), cortex.region)
    assert np.isnan(smoothed[:, outside]).all()
    single = gc.brain.smooth(cortex, values[0], fwhm=20.0)
    np.testing.assert_array_equal(single, smoothed[0])


@pytest.mark.jit
def test_a_peak_in_the_plane_becomes_the_gaussian_of_its_width():
    plane = gc.samples.plane(3200)
    cortex = gc.brain.load_cortex({"left": plane})
    place = np.hypot(*(plane.vertices[:, :2] - 0.5).T)
    centre, fwhm = int(place.argmin()), 0.2
    peak = np.zeros(len(place))
    peak[centre] = 1.0 / cortex.areas[centre]
    sigma = fwhm / math.sqrt(8 * math.log(2))
    distance = np.hypot(*(plane.vertices[:, :2] - plane.vertices[centre, :2]).T)
    gaussian = np.exp(-0.5 * (distance / sigma) ** 2) / (2 * math.pi * sigma**2)
    spread = gc.brain.smooth(cortex, peak, fwhm)
    assert np.abs(spread - gaussian).max() < 0.01 * gaussian.max()


@pytest.mark.parametrize("fwhm", [0.0, -1.0, math.inf, math.nan, "6"])
def test_widths_out_of_their_domain_are_refused(surfaces, fwhm):
    cortex = gc.brain.load_cortex({"left": surfaces["left"]})
    with pytest.raises(gc.errors.InvalidArgument, match="fwhm"):
        gc.brain.smooth(cortex, np.zeros(len(cortex.areas)), fwhm)


def test_values_that_are_missing_or_of_another_surface_are_refused(surfaces):
    cortex = gc.brain.load_cortex({"left": surfaces["left"]})
    values = np.zeros(len(cortex.areas))
    values[7] = np.nan
    with pytest.raises(gc.errors.InvalidArgument, match="vertex 7 of the left surface has no"):
        gc.brain.smooth(cortex, values, 5.0)
    with pytest.raises(gc.errors.OtherSurface, match="161 values for the 162 vertices of the left"):
        gc.brain.smooth(cortex, values[1:], 5.0)

"""Which bands count, and at which frequency."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evenlight.data_schema.contrast_model import BandFrequency
from evenlight.data_schema.display import Display
from evenlight.method.contrast.pyramid import (
    band_frequencies,
    gaussian_pyramid,
    laplacian_bands,
    level_shapes,
)

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=72.28)


def test_bands_of_the_paper_s_display_at_1080p():
    """Nyquist 36.14 cpd, halved while at least 0.5 cpd: 36.14 / 2^6 = 0.565 is the last."""
    expected = 36.14 / 2.0 ** np.arange(7)
    np.testing.assert_allclose(band_frequencies((1080, 1920), LAB), expected)


def test_authors_labels_are_a_quarter():
    """As in the authors' script: the finest band is said to be 36.14 / 4 = 9.035 cpd."""
    got = band_frequencies((1080, 1920), LAB, BandFrequency.AUTHORS)
    np.testing.assert_allclose(got, [9.035, 4.5175, 2.25875, 1.129375, 0.5646875])


@pytest.mark.slow
def test_centroids_are_those_of_the_filters():
    """Mean power of each band's response to a sinusoid, over all frequencies up to Nyquist."""
    shares, length, depth = np.linspace(0.002, 1, 200), 513, 5
    energy = np.zeros((depth, len(shares)))
    x = np.arange(length)
    for column, share in enumerate(shares):
        for phase in (0, np.pi / 2):
            wave = np.tile(np.cos(np.pi * share * x + phase), (2, 1))
            bands = laplacian_bands(gaussian_pyramid(wave, depth + 1))
            energy[:, column] += [(band[0, 4:-4] ** 2).mean() for band in bands]
    centroids = (energy * shares).sum(axis=1) / energy.sum(axis=1)
    unlimited = band_frequencies((512, 512), LAB, BandFrequency.CENTROID, lowest_frequency=1e-9)
    np.testing.assert_allclose(unlimited[:depth] / LAB.nyquist_frequency, centroids, rtol=0.02)


@given(st.integers(3, 300), st.integers(3, 300), st.sampled_from(BandFrequency), st.floats(0.1, 500))
def test_every_band_has_a_level_two_down_and_there_is_at_least_one(height, width, rule, pixels_per_degree):
    display = dataclasses.replace(LAB, pixels_per_degree=pixels_per_degree)
    frequencies = band_frequencies((height, width), display, rule)
    assert 1 <= len(frequencies) <= len(level_shapes((height, width))) - 2
    assert (frequencies[1:] >= 0.5).all()


@pytest.mark.parametrize(("asked", "got"), [(2, 2), (12, 4)])
def test_a_band_count_replaces_the_lowest_frequency(asked, got):
    """32 pixels have the levels 32, 16, 8, 4, 2, 1: four with another two levels down."""
    coarse = dataclasses.replace(LAB, pixels_per_degree=2.0)
    assert len(band_frequencies((32, 32), coarse)) == 2
    assert len(band_frequencies((32, 32), coarse, band_count=asked)) == got

"""Pyramids, contrast, masking, visibility and loss: by hand, and as printed."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evenlight.data_schema.contrast_model import (
    BandFrequency,
    ContrastModel,
    MaskingNeighbourhood,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import (
    contrast_loss,
    loss_of,
    perceived_contrasts,
    visible_contrast,
    visible_map,
)
from evenlight.method.contrast.csf import contrast_sensitivity, csf_contrast
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.method.contrast.masking import neighbourhood_mean, perceived_contrast
from evenlight.method.contrast.pyramid import (
    adaptation_luminance,
    expanded,
    gaussian_pyramid,
    laplacian_bands,
    level_shapes,
)

KERNEL = np.outer(*2 * [[0.05, 0.25, 0.4, 0.25, 0.05]])  # Burt & Adelson (1983), a = 0.4

SHAPES = [(8, 8), (9, 13), (16, 11), (3, 7), (2, 2), (1, 5), (1, 1)]


def mirror(i, n):
    """Where index i lies in ... 2 1 0 1 2 ... n-2 n-1 n-2 ..."""
    while not 0 <= i < n:
        i = -i if i < 0 else 2 * (n - 1) - i
        if n == 1:
            return 0
    return i


def reduce_as_printed(fine):
    """g_l(i, j) = Σ_m Σ_n w(m, n) g_{l-1}(2i + m, 2j + n)."""
    height, width = fine.shape
    coarse = np.zeros(((height + 1) // 2, (width + 1) // 2))
    for i, j in np.ndindex(coarse.shape):
        for m in range(-2, 3):
            for n in range(-2, 3):
                at = mirror(2 * i + m, height), mirror(2 * j + n, width)
                coarse[i, j] += KERNEL[m + 2, n + 2] * fine[at]
    return coarse


def expand_as_printed(coarse, shape):
    """g_{l,n}(i, j) = 4 Σ_m Σ_n w(m, n) g_{l,n-1}((i - m)/2, (j - n)/2), over the terms that exist."""
    fine = np.zeros(shape)
    for i, j in np.ndindex(shape):
        for m in range(-2, 3):
            for n in range(-2, 3):
                at = mirror(i - m, shape[0]), mirror(j - n, shape[1])
                # Parity of i - m and of its mirror agree: a mirror moves an index by an even number.
                if at[0] % 2 == 0 and at[1] % 2 == 0:
                    fine[i, j] += 4 * KERNEL[m + 2, n + 2] * coarse[at[0] // 2, at[1] // 2]
    return fine


@pytest.fixture(params=SHAPES, ids=str)
def image(request):
    return np.random.default_rng(1).uniform(0, 100, request.param)


def test_reduction_is_as_printed(image):
    np.testing.assert_allclose(gaussian_pyramid(image, 2)[1], reduce_as_printed(image), rtol=1e-12)


def test_expansion_is_as_printed(image):
    coarse = gaussian_pyramid(image, 2)[1]
    if min(image.shape) > 1:  # along a side of one pixel the printed sum has only the centre tap
        np.testing.assert_allclose(
            expanded(coarse, image.shape), expand_as_printed(coarse, image.shape), rtol=1e-12
        )


def test_bands_and_residual_give_the_image_back(image):
    levels = gaussian_pyramid(image, len(level_shapes(image.shape)))
    collapsed = levels[-1]
    for band in reversed(laplacian_bands(levels)):
        collapsed = band + expanded(collapsed, band.shape)
    np.testing.assert_allclose(collapsed, image, rtol=1e-12)


def test_level_sizes_are_those_of_the_pyramid(image):
    shapes = level_shapes(image.shape)
    assert [level.shape for level in gaussian_pyramid(image, len(shapes))] == shapes
    assert min(shapes[-1]) == 1


@given(st.floats(1e-6, 1e6), st.tuples(st.integers(1, 20), st.integers(1, 20)))
def test_an_area_of_one_luminance_has_no_contrast_at_all(value, shape):
    """Not even rounding noise, which masking would magnify (0.2th power)."""
    levels = gaussian_pyramid(np.full(shape, value), 4)
    assert all((band == 0).all() for band in laplacian_bands(levels))
    assert (adaptation_luminance(levels, 1) == value).all()


def test_a_ramp_passes_to_the_next_level_inside_the_frame():
    """The kernel is symmetric and its taps sum to 1 at either parity, so it reproduces straight lines."""
    ramp = np.tile(np.arange(32.0), (32, 1))
    levels = gaussian_pyramid(ramp, 2)
    assert np.abs(laplacian_bands(levels)[0][6:-6, 6:-6]).max() < 1e-12


@given(arrays(np.float64, (9, 6), elements=st.floats(0, 100)))
def test_rows_and_columns_are_treated_alike(image):
    upright, turned = (laplacian_bands(gaussian_pyramid(x, 3)) for x in (image, image.T))
    for a, b in zip(upright, turned, strict=True):
        np.testing.assert_allclose(a, b.T, atol=1e-11)


@given(arrays(np.float64, (17, 9), elements=st.floats(0, 100)))
def test_a_mirrored_image_has_the_mirrored_pyramid(image):
    """Where sides are 2^k + 1, so that every level samples both edges."""
    straight, mirrored = (laplacian_bands(gaussian_pyramid(x, 4)) for x in (image, image[:, ::-1]))
    for a, b in zip(straight, mirrored, strict=True):
        np.testing.assert_allclose(a, b[:, ::-1], atol=1e-11)


@given(arrays(np.float64, (8, 8), elements=st.floats(0, 1e4)))
def test_adaptation_luminance_lies_within_the_luminances_of_the_frame(image):
    """Both steps are averages with positive weights."""
    adaptation = adaptation_luminance(gaussian_pyramid(image, 4), 1)
    margin = 1e-12 * image.max()
    assert adaptation.min() >= image.min() - margin
    assert adaptation.max() <= image.max() + margin


def test_the_image_is_not_written_to():
    image = np.ones((8, 8))
    image.flags.writeable = False
    gaussian_pyramid(image, 4)


# --- contrast loss

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)

ALTERNATIVES = [
    ContrastModel(),
    ContrastModel(band_frequency=BandFrequency.CENTROID, lowest_frequency=2.0),
    ContrastModel(sensitivity=SensitivityModel.SIMPLIFIED, field_size=20.0, epsilon=0.1),
    ContrastModel(sensitivity=SensitivityModel.AUTHORS, band_frequency=BandFrequency.AUTHORS),
    ContrastModel(masking=MaskingNeighbourhood.WITHOUT_CENTRE, visibility=Visibility.POSITIVE_ONLY),
]

frames = arrays(np.float64, st.tuples(st.integers(8, 14), st.integers(8, 14)), elements=st.floats(0.05, 100))


def test_equation_2_by_hand():
    """ΔL = 3, L_a = 59.5, ε = 0.5, S = 100: C = 5; darker detail is as strong."""
    np.testing.assert_allclose(csf_contrast([3.0, -3.0], 59.5, 100.0, epsilon=0.5), [5.0, -5.0])


def test_a_lone_contrast_is_masked_only_by_itself():
    """|C| = 32 amid 24 zeros: 32^0.7 / (1 + 32^0.2 / 25) = 2^3.5 / (1 + 2/25); without itself, 2^3.5."""
    band = np.zeros((7, 7))
    band[3, 3] = -32.0
    assert perceived_contrast(band)[3, 3] == pytest.approx(-(2**3.5) / 1.08)
    assert perceived_contrast(band, MaskingNeighbourhood.WITHOUT_CENTRE)[3, 3] == pytest.approx(-(2**3.5))


def test_equal_contrasts_are_visible_from_3_21_thresholds_on():
    """x^0.7 = 1 + x^0.2 has its root between 3.2108 and 3.2110."""
    assert 3.2108**0.7 < 1 + 3.2108**0.2
    assert 3.2110**0.7 > 1 + 3.2110**0.2
    assert perceived_contrast(np.full((5, 5), 3.2108)).max() < 1
    assert perceived_contrast(np.full((5, 5), 3.2110)).min() > 1


def test_at_the_border_the_neighbourhood_counts_the_pixels_that_exist():
    """The corner of a frame sees 3 x 3 pixels, and its N is 9."""
    values = np.arange(36.0).reshape(6, 6)
    assert neighbourhood_mean(values)[0, 0] == pytest.approx(values[:3, :3].mean())
    others = (values[:3, :3].sum() - values[0, 0]) / 8
    assert neighbourhood_mean(values, MaskingNeighbourhood.WITHOUT_CENTRE)[0, 0] == pytest.approx(others)


def visible_as_printed(band, adaptation, S, model):
    """Equations 2 to 4 for one band, pixel by pixel."""
    C = band / (adaptation + model.epsilon) * S
    count = 0
    for y, x in np.ndindex(C.shape):
        masking, N = 0.0, 0
        for v in range(max(y - 2, 0), min(y + 3, C.shape[0])):
            for u in range(max(x - 2, 0), min(x + 3, C.shape[1])):
                if model.masking is MaskingNeighbourhood.WITH_CENTRE or (v, u) != (y, x):
                    masking, N = masking + abs(C[v, u]) ** 0.2, N + 1
        C_t = np.sign(C[y, x]) * abs(C[y, x]) ** 0.7 / (1 + masking / max(N, 1))
        count += C_t > 1 if model.visibility is Visibility.POSITIVE_ONLY else abs(C_t) > 1
    return count / C.size


@pytest.mark.parametrize("model", ALTERNATIVES)
@pytest.mark.parametrize("shape", [(8, 8), (9, 13), (12, 10)])
def test_visible_contrast_is_as_printed(model, shape):
    luminance = np.random.default_rng(5).uniform(0.1, 100, shape) ** 2 / 100
    # By the rules of the decision pages, at a Nyquist frequency of 30 cpd.
    halved = np.array([1.0, 0.5, 0.25])
    rules = {BandFrequency.NYQUIST: 30 * halved, BandFrequency.AUTHORS: 7.5 * halved}
    frequencies = rules.get(model.band_frequency, 30 * np.array([0.672, 0.294, 0.138]))
    n_bands = len(level_shapes(shape)) - 2
    gaussian = gaussian_pyramid(luminance, n_bands + 2)
    shares = []
    for level, f in enumerate(frequencies[:n_bands]):
        adaptation = adaptation_luminance(gaussian, level)
        seen = adaptation.mean() if model.sensitivity is SensitivityModel.AUTHORS else adaptation
        S = contrast_sensitivity(f, seen, model.sensitivity, model.field_size)
        shares.append(visible_as_printed(laplacian_bands(gaussian)[level], adaptation, S, model))
    assert visible_contrast(luminance, LAB, model) == pytest.approx(np.mean(shares), abs=1e-12)


@pytest.mark.parametrize(
    ("dimmed", "reference", "loss"), [(0.3, 0.4, 0.25), (0.9, 0.4, 1.0), (0.0, 0.0, 0.0)]
)
def test_equation_5_by_hand(dimmed, reference, loss):
    """|1 - 3/4|; |1 - 9/4| is held at 1; nothing visible has nothing to lose."""
    assert loss_of(dimmed, reference) == pytest.approx(loss)


@pytest.mark.slow
@given(frames, st.floats(0.01, 1))
def test_loss_is_a_share_and_0_undimmed(frame, factor):
    assert 0 <= contrast_loss(frame, factor, LAB) <= 1
    assert contrast_loss(frame, 1.0, LAB) == 0


@pytest.mark.slow
@given(st.floats(0, 1e4), st.floats(0.01, 1), st.sampled_from(ALTERNATIVES))
def test_a_uniform_frame_shows_and_loses_nothing(value, factor, model):
    frame = np.full((9, 13), value)
    assert visible_contrast(frame, LAB, model) == 0
    assert contrast_loss(frame, factor, LAB, model) == 0


@pytest.mark.slow
@given(arrays(np.float64, (17, 9), elements=st.sampled_from([1.0, 20.0, 100.0])))
def test_a_mirrored_frame_shows_the_same(frame):
    maps, mirrored = visible_map(frame, LAB), visible_map(frame[:, ::-1], LAB)
    different = sum(int((a != b[:, ::-1]).sum()) for a, b in zip(maps, mirrored, strict=True))
    assert different <= 1  # at the very threshold


def test_positive_only_splits_both_polarities():
    frame = np.random.default_rng(2).uniform(0.1, 100, (32, 32))
    both = visible_map(frame, LAB)
    bright = visible_map(frame, LAB, ContrastModel(visibility=Visibility.POSITIVE_ONLY))
    signs = [np.sign(band) for band in perceived_contrasts(frame, LAB)]
    for one, other, sign in zip(both, bright, signs, strict=True):
        np.testing.assert_array_equal(other, one & (sign > 0))
        assert 0 < other.sum() < one.sum()


@pytest.mark.parametrize("shape", [(8, 8), (9, 13), (3, 200)])
@pytest.mark.parametrize("level", [0.0, 1e-4, 1e4])
def test_one_bright_pixel_gives_finite_answers(shape, level):
    """Down to no light at all around it, where L_a of distant pixels is 0."""
    frame = np.full(shape, level)
    frame[shape[0] // 2, shape[1] // 2] = 1e4 + level
    assert 0 < visible_contrast(frame, LAB) <= 1
    assert 0 <= contrast_loss(frame, 0.2, LAB) <= 1


def test_reflected_light_takes_contrast():
    """The same emitted frame in a brighter room: every |C| falls, S rises less than L."""
    frame = np.random.default_rng(4).uniform(1, 100, (64, 64))
    room = dataclasses.replace(LAB, reflected_luminance=20.0)
    dark, bright = (visible_contrast(dimmed_luminance(frame, 1.0, d), d) for d in (LAB, room))
    assert bright < dark


@pytest.mark.slow
@given(frames)
def test_rows_and_columns_matter_alike(frame):
    """Up to one pixel at the very threshold."""
    one_pixel = 1 / 4
    assert visible_contrast(frame.T, LAB) == pytest.approx(visible_contrast(frame, LAB), abs=one_pixel / 2)


def test_dimming_loses_contrast_through_sensitivity_alone():
    """With D = b · I alone, without reflections and ε, ΔL / L_a is that of the undimmed frame."""
    frame = np.random.default_rng(4).uniform(0, 100, (16, 16))
    undimmed, dimmed = gaussian_pyramid(frame, 4), gaussian_pyramid(0.25 * frame, 4)
    for level in range(2):
        ratios = [laplacian_bands(g)[level] / adaptation_luminance(g, level) for g in (undimmed, dimmed)]
        np.testing.assert_allclose(*ratios, rtol=1e-12)

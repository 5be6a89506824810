"""What measures say of one track, frame by frame: the numbers of docs/validity.md.

`python -m benchmarks.validity VIDEO TRACK` samples the video's frames evenly and evaluates each at the factor
of the track and at constant dimming of equal power, by each measure, and by ColorVideoVDP where the extra
`judge` is installed: stock, which takes the sensitivity to both images from the reference, and a variant in
which each image has its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from evenlight.analysis.judgement.judgement import rank_correlation
from evenlight.analysis.judgement.modulation import BEST, Light, installed_metric
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.tracks.loaded_track import load_track
from evenlight.method.contrast.luminance import linear_channels
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.optimizer.objective import pairwise_spread
from evenlight.method.preset_files import load_display
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.viewing_geometry import seen_video

SAMPLES = 61
Loss = Callable[[Any, float], float]  # of pixel values, at a factor


def losses_of(video: str, folder: Path, samples: int = SAMPLES) -> Iterator[tuple[str, Array, Array]]:
    """Yield each measure, and the losses of sampled frames by it under a track and constant dimming.

    Parameters
    ----------
    video, folder : str, Path
        The video, and what `evenlight optimize` wrote for it, on the default display.
    samples : int
        How many frames are evaluated.
    """
    loaded, source = load_track(folder), open_video(video)
    track = loaded.track
    chosen = set(np.linspace(0, len(track.times) - 1, samples).astype(int).tolist())
    display = load_display(track.header.display_name)
    shown, geometry = seen_video(source.frames(), display, track.header.field_of_view or 0.0, source.name)
    frames = [(k, frame.pixel_values.copy()) for k, frame in enumerate(shown) if k in chosen]
    size = frames[0][1].shape[:2]
    for name, loss in measures_on(geometry.display, (size[0], size[1])).items():
        ours = [loss(pixels, float(track.factors[k])) for k, pixels in frames]
        constant = [loss(pixels, loaded.baseline) for _, pixels in frames]
        yield name, np.array(ours), np.array(constant)


def measures_on(display: Display, shape: tuple[int, int]) -> dict[str, Loss]:
    """Return all measures as functions of a frame and a factor; of ColorVideoVDP the JOD that is lost."""

    def measured(model: ContrastModel) -> Loss:
        one_factor = OneFactorLoss(shape, display, model)
        return lambda pixels, b: one_factor.of(pixels, b).loss

    found = {name: measured(model) for name, model in MEASURES.items()}
    if installed_metric() is not None:
        found["cvvdp"] = _jod_lost(display, own_sensitivity=False)
        found["cvvdp, own sensitivity"] = _jod_lost(display, own_sensitivity=True)
    return found


def _jod_lost(display: Display, own_sensitivity: bool) -> Loss:
    """Return the quality that ColorVideoVDP finds lost in an image, beside full brightness [JOD]."""
    import pycvvdp
    import torch

    torch.set_num_threads(1)
    metric: Any = None

    def lost(pixels: Any, factor: float) -> float:
        nonlocal metric
        if metric is None:
            metric = pycvvdp.cvvdp(
                display_photometry=pycvvdp.vvdp_display_photo_eotf(
                    Y_peak=display.peak_luminance + display.reflected_luminance, contrast=1e6,
                    source_colorspace="sRGB", EOTF="linear", E_ambient=0, k_refl=0,
                ),
                display_geometry=pycvvdp.vvdp_display_geometry(
                    [pixels.shape[1], pixels.shape[0]], ppd=display.pixels_per_degree
                ),
                quiet=True,
                device=torch.device("cpu"),
            )  # fmt: skip
            metric.predict(_light(pixels, 1.0, display), _light(pixels, 1.0, display), dim_order="HWC")
            if own_sensitivity:
                _give_own_sensitivity(metric)
        test, reference = _light(pixels, factor, display), _light(pixels, 1.0, display)
        with torch.no_grad():
            return BEST - float(metric.predict(test, reference, dim_order="HWC")[0])

    return lost


def _light(pixels: Any, factor: float, display: Display) -> Light:
    """Return the linear R, G, B of an image that reach the eye [cd/m^2]."""
    linear = linear_channels(pixels, display.gamma)
    emitted = display.black_level + (display.peak_luminance - display.black_level) * linear
    return np.asarray(factor * emitted + display.reflected_luminance, dtype=np.float32)


def _give_own_sensitivity(metric: Any) -> None:
    """Make ColorVideoVDP take the sensitivity to each image from that image's own background.

    It multiplies the contrast of both by the reference's; that of the test is brought to its own here.
    """
    import torch

    csf, masked, band_of = metric.csf, metric.apply_masking_model, metric.lpyr.get_gband
    asked: list[tuple[Any, ...]] = []
    background: list[Any] = []

    def get_band(*which: Any) -> Any:
        background[:] = [band_of(*which)]
        asked.clear()
        return background[0]

    def sensitivity(rho: Any, omega: Any, log_background: Any, channel: int, sigma: Any) -> Any:
        asked.append((rho, omega, channel, sigma))
        return csf.sensitivity(rho, omega, log_background, channel, sigma)

    def with_own(test: Any, reference: Any, common: Any) -> Any:
        own = background[0][..., 0:1, :, :, :]
        S = torch.cat([csf.sensitivity(rho, omega, own, k, sigma) for rho, omega, k, sigma in asked], dim=1)
        S = S * 10.0 ** (metric.sensitivity_correction / 20.0)
        return masked(test * S / common, reference, common)

    metric.lpyr.get_gband = get_band
    metric.csf = SimpleNamespace(sensitivity=sensitivity)
    metric.apply_masking_model = with_own


def main(video: str, folder: str, samples: str = str(SAMPLES)) -> None:
    """Print a row for each measure: levels, spreads, and rank correlation with the default."""
    print("measure | mean, constant | spread, constant | spread, track | rank correlation with the default")
    default: Array | None = None
    for measure, track, constant in losses_of(video, Path(folder), int(samples)):
        default = constant if default is None else default
        correlation = rank_correlation(default, constant)
        print(
            f"{measure} | {constant.mean():.4f} | {pairwise_spread(constant):.4f} "
            f"| {pairwise_spread(track):.4f} | {'–' if correlation is None else f'{correlation:.2f}'}"
        )


if __name__ == "__main__":
    main(*sys.argv[1:])

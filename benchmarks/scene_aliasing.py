"""How far pictures of scenes are from many more samples, at rest and in a slow pan, and what they cost.

`python -m benchmarks.scene_aliasing [--size 640x360] [--light fine]`, on a graphics processor or in software.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time

import numpy as np
from numpy.typing import NDArray

from benchmarks.scene_preview import QUALITIES, REC_709
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import visible_map
from evenlight.stimuli.scenes.content.catalogue import path_named, scene_named
from evenlight.stimuli.scenes.engine.antialiasing import LIVE, NONE, OFFLINE, Antialiasing
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer

TRUTH = Antialiasing(8)
GRIDS = {"none": NONE, "live": LIVE, "4x4": Antialiasing(4), "offline": OFFLINE}
SHARES = {"living_room": (0.1, 0.75), "basement": (0.1, 0.7), "house": (0.2, 0.4, 0.65),
          "library": (0.1, 0.4, 0.85), "gym": (0.15, 0.8)}  # fmt: skip
STEP = 1.0  # [pixel] by which the middle of the picture moves from frame to frame
PAN = 3  # frames
Pictures = list[NDArray[np.float64]]


def main() -> None:
    """Print a line for each grid."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scene_aliasing", description=__doc__)
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--light", default="fine", choices=list(QUALITIES))
    options = parser.parse_args()
    width, height = (int(x) for x in options.size.split("x"))
    pans: dict[str, list[Pictures]] = {}
    cost: dict[str, list[float]] = {}
    with offscreen_context() as context:
        print(context.info["GL_RENDERER"])
        for name, shares in SHARES.items():
            path = path_named(name)
            scene = scene_named(path.scene)
            for kind, grid in {"truth": TRUTH, **GRIDS}.items():
                renderer = SceneRenderer(context, scene, (width, height), QUALITIES[options.light], grid)
                for share in shares:
                    pictures, spent = pan(renderer, path.camera(share * path.duration))
                    pans.setdefault(kind, []).append(pictures)
                    cost.setdefault(kind, []).extend(spent)
    for kind in cost:
        print(f"{kind:8s} {_said(pans[kind], pans['truth'])}, "
              f"{np.median(np.array(cost[kind]) / cost['none']):.1f} times the processor time of none "
              f"({np.median(cost[kind]):.0f} ms)")  # fmt: skip


def pan(renderer: SceneRenderer, camera: Camera) -> tuple[Pictures, list[float]]:
    """Return the luminance of a slow pan [cd/m^2], and the processor time of each frame [ms]."""
    turn = math.degrees(STEP / camera.focal_pixels(renderer.size[0]))
    pictures, spent = [], []
    for k in range(PAN):
        busy = time.process_time()
        renderer.render(dataclasses.replace(camera, azimuth=camera.azimuth + k * turn))
        picture = renderer.luminance()
        spent.append(1000 * (time.process_time() - busy))
        pictures.append(picture.astype(float) @ REC_709)
    return pictures, spent


def _said(pans: list[Pictures], truth: list[Pictures]) -> str:
    """Return how far pictures are from the truth: at rest, in motion, and in the finest band."""
    still = [_rms(p[0] - t[0]) / t[0].mean() for p, t in zip(pans, truth, strict=True)]
    motion = [_rms(np.diff(p, axis=0) - np.diff(t, axis=0)) / _rms(np.diff(t, axis=0))
              for p, t in zip(pans, truth, strict=True)]  # fmt: skip
    finest = [_finest(p[0]) / max(_finest(t[0]), 1e-9) for p, t in zip(pans, truth, strict=True)]
    return (f"rms {_percent(still)} of the mean, flicker {_percent(motion)} of the motion, "
            f"finest band {min(finest):.2f} to {max(finest):.2f} of the truth's")  # fmt: skip


def _rms(values: NDArray[np.float64]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.square(values).mean()))


def _percent(shares: list[float]) -> str:
    """Return median and largest of some shares."""
    return f"{100 * np.median(shares):.1f} % (worst {100 * max(shares):.1f} %)"


def _finest(luminance: NDArray[np.float64]) -> float:
    """Return the share of visible pixels in the finest band that counts, at the size the camera saw."""
    display = Display("headset", 100.0, 0.1, 2.2, pixels_per_degree=luminance.shape[1] / 2 * math.pi / 180)
    return float(visible_map(luminance + 0.1, display)[0].mean())


if __name__ == "__main__":
    main()

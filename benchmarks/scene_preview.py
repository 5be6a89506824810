"""Pictures of scenes to look at, and how long they take: `python -m benchmarks.scene_preview`."""

from __future__ import annotations

import argparse
import importlib
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.content.catalogue import SCENES, path_named, scene_named
from evenlight.stimuli.scenes.engine.camera import EYE_HEIGHT, Camera
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Quality, Scene
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW

REC_709 = np.array([0.2126, 0.7152, 0.0722])
BENCHMARKED = 20  # frames
QUALITIES = {"none": None, "coarse": Quality.COARSE, "fine": Quality.FINE}


def main() -> None:
    """Write what the arguments ask for, or print how long frames take."""
    options = _options()
    try:
        if options.path or options.contact_sheet or options.benchmark:
            _along_a_path(options)
        else:
            _one_view(options)
    except InputError as error:
        raise SystemExit(f"preview: {error}") from None


def _options() -> argparse.Namespace:
    """Return the arguments."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scene_preview", description=__doc__)
    parser.add_argument("scene", nargs="?", help=f"{', '.join(SCENES)}, or MODULE:FUNCTION")
    parser.add_argument("--at", default="0,0", help="X,Y[,Z] in metres; without Z at eye height")
    parser.add_argument("--look", default="0,0", help="azimuth from north and altitude, in degrees")
    parser.add_argument("--field-of-view", type=float, default=FIELD_OF_VIEW, help="horizontal, in degrees")
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--light", default="fine", choices=list(QUALITIES))
    parser.add_argument("--path", help="name of a path or a file: frames at --times, side by side")
    parser.add_argument("--times", default="0", help="T1,T2,... in seconds")
    parser.add_argument("--contact-sheet", metavar="PATH", help="16 frames of a path, with their luminance")
    parser.add_argument("--benchmark", metavar="PATH", help="print the time per frame over a path")
    parser.add_argument("--out", type=Path, default=Path("preview.png"))
    return parser.parse_args()


def _one_view(options: argparse.Namespace) -> None:
    """Write one frame."""
    place, look = ([float(x) for x in text.split(",")] for text in (options.at, options.look))
    x, y, z = (*place, EYE_HEIGHT)[:3]
    renderer = _renderer(_scene(options.scene or "house"), options)
    camera = Camera((x, y, z), look[0], look[1], options.field_of_view)
    picture = frame(renderer, camera)
    print(f"mean luminance {mean_luminance(renderer):.2f} cd/m^2")
    Image.fromarray(picture).save(options.out)


def _along_a_path(options: argparse.Namespace) -> None:
    """Write frames of a path, or time them."""
    path = path_named(options.path or options.contact_sheet or options.benchmark)
    renderer = _renderer(_scene(path.scene), options)
    if options.benchmark:
        _print_times(path, renderer)
    elif options.contact_sheet:
        times = np.linspace(0, path.duration, 16).tolist()
        contact_sheet(path, renderer, times, columns=4).save(options.out)
    else:
        times = [float(x) for x in options.times.split(",")]
        contact_sheet(path, renderer, times, columns=min(len(times), 3)).save(options.out)


def _scene(name: str) -> Scene:
    """Return a scene by its name, or what a function MODULE:FUNCTION returns for a seed."""
    if ":" not in name:
        return scene_named(name)
    module, function = name.split(":")
    scene: Scene = getattr(importlib.import_module(module), function)(1)
    return scene


def _renderer(scene: Scene, options: argparse.Namespace) -> SceneRenderer:
    """Return a renderer of the size that was asked for."""
    start = time.perf_counter()
    width, height = (int(x) for x in options.size.split("x"))
    renderer = SceneRenderer(offscreen_context(), scene, (width, height), QUALITIES[options.light])
    print(f"{len(scene.patches)} patches, {len(scene.materials)} materials, ready after "
          f"{time.perf_counter() - start:.1f} s")  # fmt: skip
    return renderer


def frame(renderer: SceneRenderer, camera: Camera) -> NDArray[np.uint8]:
    """Return what a camera sees, 8 bits, (height, width, 3)."""
    renderer.render(camera)
    renderer.encode()
    return (renderer.pixel_values() >> 8).astype(np.uint8)


def mean_luminance(renderer: SceneRenderer) -> float:
    """Return the mean luminance of the last frame as a display shows it [cd/m^2]."""
    from evenlight.stimuli.scenes.engine.graphics import PEAK

    shown = (renderer.pixel_values() / 65535) ** 2.2 * PEAK
    return float(shown.mean(axis=(0, 1)) @ REC_709)


def contact_sheet(path: CameraPath, renderer: SceneRenderer, times: list[float], columns: int) -> Image.Image:
    """Return frames of a path side by side, each with its time, place and mean luminance."""
    width, height = renderer.size
    rows = -(-len(times) // columns)
    sheet = Image.new("RGB", (columns * width, rows * height))
    pen = ImageDraw.Draw(sheet)
    for k, moment in enumerate(times):
        left, top = k % columns * width, k // columns * height
        camera = path.camera(moment)
        sheet.paste(Image.fromarray(frame(renderer, camera)), (left, top))
        said = f"{moment:.1f} s, {mean_luminance(renderer):.1f} cd/m^2"
        for shift, colour in ((1, "black"), (0, "white")):
            pen.text((left + 6 + shift, top + 4 + shift), said, fill=colour)
    return sheet


def _print_times(path: CameraPath, renderer: SceneRenderer) -> None:
    """Print how long frames take, from the camera to the pixel values."""
    taken, worked = [], []
    for moment in np.linspace(0, path.duration, BENCHMARKED).tolist():
        start, busy = time.perf_counter(), time.process_time()
        frame(renderer, path.camera(moment))
        taken.append(1000 * (time.perf_counter() - start))
        worked.append(1000 * (time.process_time() - busy))
    width, height = renderer.size
    print(f"{path.name} at {width}x{height}: median {np.median(taken):.0f} ms per frame, "
          f"longest {max(taken):.0f} ms, over {BENCHMARKED} frames; "
          f"processor time of all cores: median {np.median(worked):.0f} ms")  # fmt: skip


if __name__ == "__main__":
    main()

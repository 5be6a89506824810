"""A recording of light made elsewhere: a table `time_s,value`, or the samples of a WAV file."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.light import FEWEST_SAMPLES, read_light_samples
from evenlight.hardware.protocols import LightBlock, LightStream

FULL_SCALES = {2: ("<i2", 2.0**15), 4: ("<i4", 2.0**31)}  # by bytes of a sample


def recorded_light(path: Path) -> tuple[LightStream, LightBlock]:
    """Return a recording.

    Parameters
    ----------
    path : Path
        A CSV table with the columns `time_s,value`; or a WAV file, whose first channel counts.

    Raises
    ------
    InputError
        If it is neither; the message names file and reason.
    """
    if path.suffix.lower() == ".wav":
        return _of_wave(path)
    times, values = read_light_samples(path)
    steps = np.diff(times)
    rate = float(np.rint(steps / np.median(steps)).sum() / (times[-1] - times[0]))  # times may be rounded
    return LightStream(rate, full_scale=None, dc_coupled=True), LightBlock(times, values, 0.0)


def _of_wave(path: Path) -> tuple[LightStream, LightBlock]:
    """Return the first channel of a WAV file, between -1 and 1."""
    if not path.is_file():
        raise InputError(f"{path}: there is no such file")
    try:
        with wave.open(str(path), "rb") as recording:
            rate, width, channels = (
                recording.getframerate(),
                recording.getsampwidth(),
                recording.getnchannels(),
            )
            content = recording.readframes(recording.getnframes())
    except (wave.Error, EOFError, OSError, ValueError, MemoryError) as error:
        raise InputError(f"{path}: cannot be read as a WAV file ({error})") from None
    if width not in FULL_SCALES or rate < 1:
        raise InputError(
            f"{path}: has {8 * width} bits at {rate} Hz; give a WAV file of 16 or 32 bits, whole numbers"
        )
    kind, full_scale = FULL_SCALES[width]
    frames = len(content) // (width * channels)
    values = np.frombuffer(content, kind, frames * channels)[::channels] / full_scale
    if frames < FEWEST_SAMPLES:
        raise InputError(f"{path}: holds {frames} samples; expected at least {FEWEST_SAMPLES}")
    return LightStream(float(rate), 1.0, dc_coupled=False), LightBlock(np.arange(frames) / rate, values, 0.0)

"""Natural things that the user of a notebook does, each in at most three lines, written as first guessed."""

from dataclasses import replace  # noqa: F401 - the user's
from pathlib import Path

import numpy as np
import pytest
import xarray  # noqa: F401 - the user's

import evenlight
from evenlight import samples  # noqa: F401 - the user's

THINGS = """
clip = samples.clip()
track = evenlight.optimize(clip, budget=0.5)
page = track._repr_html_()  -> (
    page.count("clip&#x27;: 75 frames, 3 s"), page.count("<img"), page.count("<li>")
) == (1, 1, len(track.first_lines[1]))

figure = track.plot()
figure.axes[0].set_title("Mine")
figure.savefig("mine.pdf")  -> figure._repr_png_() != track.plot("track")._repr_png_()

factors = track.factor_at([0.0, 1.5, 9.0])  -> factors.tolist() == track.factors[[0, 37, 74]].tolist()

factor, time = max((factor, time) for time, factor in track)  -> factor == track.factors.max()

frame = next(frame for frame in evenlight.open_video(clip) if frame.time == 0)
dimmed = track.dim(frame, frame.time)  -> (0.9 * frame.pixel_values.mean() > dimmed.mean() > 0).all()

track.apply(clip, "dimmed.mkv")  -> evenlight.open_video("dimmed.mkv").n_frames == len(track)

track.export("mpv", "clip.lua")  -> "0.000000" in Path("clip.lua").read_text()

track.save("track")
again = evenlight.load("track")  -> again == track != evenlight.optimize(again.curves, 0.6)

limit = evenlight.load_rate_limit("surace2025")
allowed = limit(np.array([10.0, 50.0]))  -> allowed.shape == (2,) and 0 < allowed[0] < allowed[1]

limit.save("limit.json")
again = evenlight.load("limit.json")  -> again == limit

fit = evenlight.fit_ramps(samples.ramps())
mine = evenlight.optimize(clip, 0.5, rate_limit=fit.rate_limit)  -> mine.factors.mean().round(6) == 0.5

table = samples.ratings()
found = evenlight.analyze(table).statistics
means = table.groupby(["sequence", "version"]).rating.mean()  -> set(means) <= set(found.value)

mine = replace(evenlight.load_display("laptop-lcd"), name="mine")
mine.save("mine.toml")  -> evenlight.load("mine.toml") == mine

mine = replace(evenlight.load_power_model("surace2025"), name="mine", base_power=0.2)
mine.save("panel.toml")
brighter = evenlight.optimize(clip, 0.5, power_model="panel.toml")  -> evenlight.load("panel.toml") == mine

frames = [xarray.DataArray(frame) for frame in noise]
short = evenlight.optimize(frames, 0.5, fps=25)  -> len(short) == len(noise)
"""
REFUSED = {
    "evenlight.optimize(clip, 0.5, progress=False)": "in Python, evenlight.progress.in_notebooks = False",
    "fit.save('fit'); evenlight.load('fit')": "fit: holds no track .* rate limits with `load_rate_limit`",
    "evenlight.analyze(samples.ramps())": "no column sequence; .* ramps are for `fit_ramps`",
    "evenlight.analyze(table).save('found'); evenlight.load('found')": "found: holds no track .* with pandas",
}


def test_what_is_guessed_works_or_is_told_what_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    here = globals() | {"noise": np.random.default_rng(1).random((9, 36, 64, 3))}
    for thing in THINGS.strip().split("\n\n"):
        code, _, claim = thing.partition("  -> ")
        assert code.count("\n") < 3
        exec(code, here)
        assert eval(claim, here), thing
    for code, words in REFUSED.items():
        with pytest.raises(evenlight.InputError, match=words):
            exec(code, here)

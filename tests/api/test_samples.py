"""Sample data: small, the same each time, labelled simulated, and analysed to what they were drawn from."""

import functools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import evenlight
from evenlight import samples
from evenlight.data_schema.errors import InputError

# tests/pipeline and tests/analysis draw the same pictures.
pytestmark = pytest.mark.usefixtures("blank_pictures")


def test_the_clip_is_three_seconds_whose_light_moves(tmp_path: Path) -> None:
    file = samples.clip(tmp_path)
    frames = list(evenlight.open_video(str(file)).frames())
    assert len(frames) == 75
    assert frames[-1].time + frames[-1].duration == pytest.approx(3.0)
    assert frames[0].shape == (180, 320)
    light = [((frame.pixel_values / 255) ** 2.2).mean(axis=(0, 2)) for frame in (frames[0], frames[-1])]
    ends = np.array([[one[:80].mean(), one[-80:].mean()] for one in light])
    assert ends[0, 0] > 3 * ends[0, 1]
    assert ends[1, 1] > 3 * ends[1, 0]


def test_ramps_give_the_rate_limit_that_they_were_drawn_from() -> None:
    fit = evenlight.fit_ramps(samples.ramps())
    as_in_trials = {"luminance_cd_m2": "initial_luminance_cd_m2"}
    assert evenlight.fit_ramps(samples.ramps().rename(columns=as_in_trials)) == fit
    assert evenlight.fit_ramps(samples.ramps(7)) != fit
    assert fit.rate_limit.simulated
    assert "simulated" in fit.heading
    truth = evenlight.load_rate_limit("surace2025")
    ratios = fit.rate_limit(samples.LUMINANCES) / truth(samples.LUMINANCES)
    assert np.abs(np.log(ratios)).max() < 3 * 0.3 / np.sqrt(8)  # three standard errors of eight people's mean


@pytest.mark.parametrize("name", ["ratings", "comparisons", "searches"])
def test_a_table_is_the_same_each_time_and_says_that_nobody_answered(name: str) -> None:
    table = getattr(samples, name)()
    assert table.equals(getattr(samples, name)())
    found = evenlight.analyze(table)
    assert "simulated participants" in found.lead
    assert found.sections[0].simulated


@pytest.mark.parametrize("task", ["rating", "comparison", "search", "ramp"])
def test_a_table_that_is_kept_is_imported_as_it_stands(
    tmp_path: Path, command: Callable[..., Any], task: str
) -> None:
    getattr(samples, "searches" if task == "search" else f"{task}s")(3).to_csv(
        tmp_path / "kept.csv", index=False
    )
    shown_on = ("--display", "varjo-xr3") if task == "ramp" else ()
    ended = command("import", tmp_path / "kept.csv", "--task", task, *shown_on, "--out", tmp_path / "lab")
    assert (ended.code, "simulated: all rows say so" in ended.out) == (0, True), ended.err


@pytest.mark.parametrize("count", [0, -1, "3", 2.5])
def test_a_number_of_people_that_cannot_be_is_refused_by_its_name(count: Any) -> None:
    drawn = functools.partial(evenlight.RampFit.inference_data, SimpleNamespace(calibration=None))
    for table in (samples.ramps, samples.ratings, samples.comparisons, samples.searches, drawn):
        with pytest.raises(InputError, match=r"^(participants|draws) must be a whole number from 1 on"):
            table(count)


def test_the_effects_are_those_that_are_named() -> None:
    """Of many people; four standard errors."""
    versions = samples.ratings(300).groupby("version").rating.mean()
    assert versions["ours"] - versions["baseline"] == pytest.approx(0.5, abs=4 * 0.85 * (2 / 1200) ** 0.5)
    chosen = samples.comparisons(300)
    ours = (chosen.response == "first") == (chosen.ours_interval == 1)
    assert ours.mean() == pytest.approx(0.5, abs=4 * 0.5 / len(chosen) ** 0.5)
    found = samples.searches(300)
    means = found.assign(ln=np.log(found.search_time_s)).pivot_table("ln", "keypoint", "version")
    brighter = np.log(found.pivot_table("factor", "keypoint", "version"))
    change, light = means.ours - means.baseline, brighter.ours - brighter.baseline
    slope = float((change * light).sum() / (light**2).sum())
    error = 0.5 * (2 / 300) ** 0.5 / float((light**2).sum()) ** 0.5
    assert slope == pytest.approx(-0.4, abs=4 * error)

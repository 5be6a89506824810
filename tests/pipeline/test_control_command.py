"""`evenlight control`, from a video file to its results: what the controller did, and what it knew."""

import json
from pathlib import Path

import numpy as np
import pytest

from evenlight.analysis.tracks.track_words import alike, watts
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loaded_track import load_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.optimizer.objective import pairwise_spread
from evenlight.stimuli.dimmed.track_fit import require_fit
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video_writer import write_video

pytestmark = pytest.mark.usefixtures("blank_pictures")

TABLES = {"track.csv", "track.json", "summary.json", "loss_curves.npz", "request.toml"}
FIGURES = {"track.png", "contrast_map.png"}


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the figures of the track, in tests that are about what else there is."""
    monkeypatch.setattr("evenlight.analysis.tracks.track_results._draw", lambda *_: None)


def room(seed: int, light: float) -> np.ndarray:
    """A picture with detail at every scale in some light, uint8."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(36)[:, None], np.fft.rfftfreq(48)[None, :])
    picture = np.fft.irfft2(
        np.fft.rfft2(rng.standard_normal((36, 48))) / np.maximum(frequency, 1 / 48), (36, 48)
    )
    gray = np.clip(light * (1 + 0.4 * picture / picture.std()), 0, 1)
    return np.repeat((255 * gray).round().astype(np.uint8)[..., None], 3, axis=2)


def oled(base_power: float) -> PowerModel:
    """A panel that takes 3 W more for white."""
    return PowerModel("oled", PanelKind.OLED, base_power, red_power=0.5, green_power=1.0, blue_power=1.5)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bright room, a dark one, the bright one: 10 s each at 5 Hz."""
    path = tmp_path_factory.mktemp("walk") / "walk.mkv"
    write_video(path, [room(1, 0.6)] * 50 + [room(2, 0.15)] * 50 + [room(1, 0.6)] * 50, 5.0)
    return path


@pytest.fixture(scope="module")
def another_end(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same for 12 s, and then another room."""
    path = tmp_path_factory.mktemp("walk") / "walk.mkv"
    write_video(path, [room(1, 0.6)] * 50 + [room(2, 0.15)] * 10 + [room(3, 0.4)] * 90, 5.0)
    return path


def controlled(command, out: Path, video: Path, *more: object):
    """Run the command, and return its track, summary and control."""
    result = command("control", "--no-player", video, "--out", out, *more)
    assert result.code == 0, result.err
    assert {file.name for file in out.iterdir()} >= TABLES
    track = read_track(out / "track.csv")
    assert (np.abs(track.rate) <= track.rate_limit).all()
    summary = json.loads((out / "summary.json").read_text())
    return track, summary, summary["control"], result.out


def test_the_results_say_what_the_controller_did(command, tmp_path: Path, walk: Path) -> None:
    track, summary, control, said = controlled(command, tmp_path / "out", walk, "--target-loss", 0.05)
    assert {file.name for file in (tmp_path / "out").iterdir()} == TABLES | FIGURES | {"SHA256SUMS"}
    curves = read_loss_curves(tmp_path / "out" / "loss_curves.npz")
    np.testing.assert_allclose(track.contrast_loss, loss_at(curves, track.factors), atol=1e-12)
    constant = loss_at(curves, np.full(150, track.factors.mean()))
    assert summary["solver"] == "pid"
    assert summary["budget"] == summary["achieved"] == pytest.approx(track.factors.mean(), rel=1e-12)
    assert summary["baseline_factor"] == summary["mean_factor"]
    assert summary["objective"] == pytest.approx(pairwise_spread(track.contrast_loss), rel=1e-9)
    assert summary["objective_baseline"] == pytest.approx(pairwise_spread(constant), rel=1e-9)
    assert summary["lower_bound"] == 0
    assert control["sd_loss"] == pytest.approx(track.contrast_loss.std(), rel=1e-9)
    assert control["sd_loss_constant"] == pytest.approx(constant.std(), rel=1e-9)
    assert control["start_factor"] == track.factors[0]
    assert track.contrast_loss[0] == pytest.approx(0.05, abs=1e-3)  # it begins at the target, by the knots
    varies, evenly = alike(control["sd_loss"], control["sd_loss_constant"])
    assert f"the loss varies by {varies} points over time (SD), by {evenly} points at constant" in said
    full, mean = summary["full_power_w"], summary["mean_power_w"]
    assert f"({watts(full - mean).removesuffix(' W')} of {watts(full)}" in said
    require_fit(open_video(str(walk)), load_track(tmp_path / "out").track)  # `play` takes it


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("budget", "unit", "panel"),
    [(0.6, "factor", None), (0.7, "power", oled(0.2)), (0.8, "watt", oled(0.2)), (0.5, "power", oled(0.0))],
)
def test_nothing_of_the_frames_to_come_is_known(
    command, tmp_path: Path, walk: Path, another_end: Path, budget: float, unit: str, panel: PowerModel | None
) -> None:
    options = ("--budget", budget, "--budget-unit", unit, "--horizon", 10)
    if panel is not None:
        write_toml_record(tmp_path / "oled.power.toml", panel)
        options = (*options, "--power-model", tmp_path / "oled.power.toml")
    tracks = [
        controlled(command, tmp_path / name, video, *options)[0]
        for name, video in (("one", walk), ("other", another_end))
    ]
    np.testing.assert_array_equal(tracks[0].factors[:60], tracks[1].factors[:60])
    assert (tracks[0].factors[61:] != tracks[1].factors[61:]).any()


@pytest.mark.usefixtures("undrawn")
def test_a_budget_is_met_over_its_horizon(command, tmp_path: Path, walk: Path) -> None:
    track, summary, control, said = controlled(
        command, tmp_path / "out", walk, "--budget", 0.7, "--budget-unit", "power", "--horizon", 20
    )
    assert summary["achieved"] == pytest.approx(0.7, abs=0.01)
    assert (summary["budget"], summary["budget_unit"]) == (0.7, "power")
    shares = track.power / summary["full_power_w"]  # of a backlight, whose full power is the same always
    windows = np.convolve(shares, np.ones(100) / 100, "valid")
    assert control["horizon_error"] == pytest.approx(np.abs(windows - 0.7).max(), rel=1e-6)
    assert control["horizon_excess"] == pytest.approx(max((windows - 0.7).max(), 0.0), rel=1e-6)
    assert control["steered_horizon_s"] == pytest.approx(40.0)  # 200 frames of 0.2 s
    assert f"over any 20 s off by {control['horizon_error']:.2g} at most, above it by" in said
    assert "the horizon of 20 s holds 100 frames, too few to steer by" in said
    checked = command("validate", tmp_path / "out")  # the budget is no promise
    assert checked.code == 0, checked.out


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("base_power", "budget", "unit"), [(0.2, 0.9, "power"), (0.2, 1.0, "watt")])
def test_a_black_video_on_an_oled_panel_is_shown_as_it_comes(
    command, tmp_path: Path, base_power: float, budget: float, unit: str
) -> None:
    """It uses less than the budget of watts, and at any factor all of its full power."""
    write_video(tmp_path / "night.mkv", [np.zeros((36, 48, 3), np.uint8)] * 60, 5.0)
    write_toml_record(tmp_path / "oled.power.toml", oled(base_power))
    track, summary, control, _ = controlled(
        command, tmp_path / "out", tmp_path / "night.mkv", "--budget", budget, "--budget-unit", unit,
        "--horizon", 5, "--power-model", tmp_path / "oled.power.toml",
    )  # fmt: skip
    assert unit == "power" or (track.factors == 1).all()
    assert summary["mean_power_w"] == pytest.approx(base_power)
    assert control["horizon_excess"] == pytest.approx(0.1 if unit == "power" else 0.0)
    write_toml_record(tmp_path / "none.power.toml", oled(0.0))
    refused = command(
        "control", tmp_path / "night.mkv", "--out", tmp_path / "no", "--budget", budget,
        "--budget-unit", unit, "--power-model", tmp_path / "none.power.toml",
    )  # fmt: skip
    assert refused.code == 2
    assert "the video is black throughout" in refused.err
    assert not (tmp_path / "no").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_target_that_is_out_of_reach_is_told(command, tmp_path: Path, walk: Path) -> None:
    _, summary, _, said = controlled(command, tmp_path / "out", walk, "--target-loss", 0.9)
    assert summary["mean_contrast_loss"] < 0.9
    assert said.count("warning: the target of 90.0 % is out of reach for") == 1
    assert "less even at the lowest factor, 0.2" in said


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((), "give --target-loss, the contrast loss to hold, or --budget"),
        (("--target-loss", 0.1, "--horizon", 9), "--horizon is for --budget, which is not given"),
        (
            ("--target-loss", 0.1, "--budget-unit", "watt"),
            "--budget-unit is for --budget, which is not given",
        ),
        (("--target-loss", 1.5), "--target-loss must lie in 0 to 1, got 1.5"),
        (("--target-loss", "nan"), "--target-loss must be a finite number, got nan"),
        (("--target-loss", 0.1, "--start-factor", 0.1), "--start-factor must lie in 0.2 to 1, got 0.1"),
        (("--target-loss", 0.1, "--integral", -1), "--integral must lie in 0 to 1e+06, got -1"),
        (("--budget", 0.1), "the budget 0.1 (factor) cannot be met"),
        (("--budget", 0.5, "--curves", "x.npz", "--jobs", 3), "--jobs and --device are for computing loss"),
        (("--budget", 0.5, "--curves", "x.npz", "--device", "gpu"), "--jobs and --device are for computing"),
        (("--budget", 0.5, "--horizon", 0), "--horizon must lie in 0.1 to 1e+06, got 0"),
        (("--budget", 0.5, "--lookahead", -1), "--lookahead must lie in 0 to 60, got -1"),
        (("--budget", 0.5, "--lookahead", 0, "--integral", 0), "--integral is for the PID controller"),
        (("--budget", 0.5, "--lookahead", 0, "--gain-rate", 90), "--gain-rate is for the PID controller"),
        (("--target-loss", 0.1, "--jobs", -1), "--jobs must be a whole number from 0 on, got -1"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    command, tmp_path: Path, options: tuple[object, ...], says: str
) -> None:
    result = command("control", "sunrise", "--out", tmp_path / "out", *options)
    assert result.code == 2
    assert says in result.err
    assert result.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_lookahead_knows_so_much_and_no_more(
    command, tmp_path: Path, walk: Path, another_end: Path
) -> None:
    """The videos differ from the frame at 12 s on: with 2 s, the frame at 9.8 s knows nothing of that."""
    tracks = []
    for name, video in (("one", walk), ("other", another_end)):
        track, summary, control, _ = controlled(
            command, tmp_path / name, video, "--budget", 0.6, "--horizon", 10, "--lookahead", 2
        )
        assert (summary["solver"], control["lookahead_s"], control["steered_horizon_s"]) == (
            "lookahead",
            2,
            10,
        )
        gains = ("proportional", "integral", "derivative", "gain_rate_hz")
        assert [control[name] for name in gains] == [None] * 4
        tracks.append(track)
    np.testing.assert_array_equal(tracks[0].factors[:50], tracks[1].factors[:50])
    assert (tracks[0].factors[50:60] != tracks[1].factors[50:60]).any()
    checked = command("validate", tmp_path / "one")
    assert checked.code == 0, checked.out


@pytest.mark.usefixtures("undrawn")
def test_where_nothing_is_gained_is_told(command, tmp_path: Path, walk: Path) -> None:
    """Without gains the factor stays: that is constant dimming."""
    none = ("--proportional", 0, "--integral", 0, "--derivative", 0, "--noticed", 0.5)
    *_, said = controlled(command, tmp_path / "out", walk, "--target-loss", 0.05, *none)
    assert " for 50 % noticed or a bound" in said
    assert said.count("warning: nothing is gained: the loss varies 1.00 times as much") == 1
    *_, said = controlled(command, tmp_path / "ahead", walk, "--target-loss", 0.05, "--lookahead", 2)
    assert "nothing is gained" not in said


@pytest.mark.usefixtures("undrawn")
def test_a_lookahead_that_the_pid_controller_beats_is_told(command, tmp_path: Path) -> None:
    """A room whose light rises: what comes is unlike what came. Of a lookahead of 0.1 s no frame is left."""
    video, curves = tmp_path / "dawn.mkv", tmp_path / "without" / "loss_curves.npz"
    write_video(video, [room(1, light) for light in np.geomspace(0.02, 0.7, 150)], 5.0)
    ratios, said = {}, {}
    for name, more in (("without", ()), ("with", ("--curves", curves, "--lookahead", 0.1))):
        *_, control, said[name] = controlled(command, tmp_path / name, video, "--budget", 0.5, *more)
        ratios[name] = control["sd_loss"] / control["sd_loss_constant"]
    assert ratios["without"] < ratios["with"]
    words = "times as much as with constant dimming by the mean factor, with it"
    warning = (
        f"without a look ahead the loss varies {ratios['without']:.2f} {words} {ratios['with']:.2f} times"
    )
    assert warning in said["with"]
    assert "without a look ahead" not in said["without"]
    assert "a lookahead of 0.1 s is less than one frame, 0.2 s: as 0" in said["with"]

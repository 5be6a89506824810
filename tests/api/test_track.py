"""The public interface: from frames to a track, and from a folder back."""

import dataclasses
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import evenlight
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.choices import LimitCurve


def scene(seed: int = 1) -> list[NDArray[np.uint8]]:
    """Forty frames of a texture under light that comes and goes."""
    texture = np.random.default_rng(seed).random((48, 64, 1)).repeat(3, axis=2)
    return [(255 * texture * (0.5 + 0.45 * np.cos(k / 6))).astype(np.uint8) for k in range(40)]


@pytest.fixture(scope="module")
def track() -> evenlight.Track:
    return evenlight.optimize(scene(), 0.5, fps=2.0)


def test_a_track_keeps_its_promises(track: evenlight.Track) -> None:
    assert len(track) == 40
    assert track.factors.mean() == pytest.approx(0.5, abs=1e-6)  # frames last equally long
    assert track.baseline == pytest.approx(0.5, abs=1e-6)
    assert track.objective < track.objective_baseline
    table = track.to_frame()
    assert (table["rate_cd_m2_s"].abs() <= table["rate_limit_cd_m2_s"] * (1 + 1e-6))[:-1].all()
    assert 0 <= track.gap < 1


def test_objective_and_baseline_are_the_spread_of_the_losses_that_the_track_tells(
    track: evenlight.Track,
) -> None:
    """Eq. 6, transcribed: the mean absolute difference over all pairs of frames."""
    for loss, expected in (
        (track.loss(), track.objective),
        (track.loss(track.baseline), track.objective_baseline),
    ):
        i, j = np.triu_indices(40, k=1)
        assert np.abs(loss[i] - loss[j]).mean() == pytest.approx(expected, abs=1e-9)


def test_power_is_linear_in_the_factor(track: evenlight.Track) -> None:
    """Eq. 7 with the panel of `surace2025`: P = P_0 + c · b · L_peak."""
    model = evenlight.load_power_model("surace2025")
    by_hand = model.base_power + model.power_per_luminance * model.peak_luminance * track.factors
    np.testing.assert_allclose(track.power(), by_hand)


def test_what_is_saved_is_loaded_again(track: evenlight.Track, tmp_path: Path) -> None:
    track.save(tmp_path / "track")
    again = evenlight.load(tmp_path / "track")
    assert (again, again.outcome) == (track, track.outcome)
    np.testing.assert_array_equal(again.loss(0.4), track.loss(0.4))
    assert (tmp_path / "track" / "track.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_and_the_function_give_the_same_track(command, tmp_path: Path, make_video) -> None:
    video = tmp_path / "film.mkv"
    make_video(video, 0.5 + 0.4 * np.cos(np.arange(30) / 5), (48, 32), 5.0)
    assert (
        command(
            "optimize", "--no-player", video, "--budget", 0.6, "--out", tmp_path / "by-command", "--quiet"
        ).code
        == 0
    )
    by_command = evenlight.load(tmp_path / "by-command")
    by_function = evenlight.optimize(video, 0.6)
    np.testing.assert_array_equal(by_function.factors, by_command.factors)
    by_function.save(tmp_path / "by-function")
    rows = [(tmp_path / by / "track.csv").read_bytes() for by in ("by-command", "by-function")]
    assert rows[0] == rows[1]
    inputs = [
        read_json_record(OptimizationSummary, tmp_path / by / "summary.json").provenance.inputs
        for by in ("by-command", "by-function")
    ]
    assert inputs[0] == inputs[1]


def test_curves_serve_for_several_budgets() -> None:
    curves = evenlight.loss_curves(scene(), fps=2.0)
    for budget in (0.4, 0.7):
        direct = evenlight.optimize(scene(), budget, fps=2.0)
        np.testing.assert_array_equal(evenlight.optimize(curves, budget).factors, direct.factors)


def test_the_loss_of_a_frame_is_that_of_its_curve() -> None:
    frame = scene()[0]
    curves = evenlight.loss_curves([frame])
    direct = evenlight.frame_loss(frame, curves.factors)
    np.testing.assert_allclose(direct, curves.loss[0], atol=1e-3)  # the documented error of the one pass
    assert direct.shape == curves.factors.shape
    assert direct[-1] == 0


def test_an_iterator_of_frames_is_read_once() -> None:
    direct = evenlight.optimize(scene(), 0.5, fps=2.0)
    once = evenlight.optimize(iter(scene()), 0.5, fps=2.0)
    np.testing.assert_array_equal(once.factors, direct.factors)
    assert once.outcome.provenance.inputs["video"] == "unknown"


def test_what_is_shown_says_what_it_is(track: evenlight.Track) -> None:
    said = repr(track)
    assert "40 frames" in said
    assert "mean factor 0.500" in said
    assert said.endswith(track.summary())
    ours, constant = track.objective, track.objective_baseline
    assert f"{100 * ours:.1f} points" in said  # one unit for a difference of losses, wherever it is told
    assert f"constant {100 * constant:.1f}" in said
    for thing in (track.curves, track.track):
        assert len(repr(thing)) < 300


def test_the_figure_shows_the_factor_the_loss_and_the_rate(track: evenlight.Track) -> None:
    labels = {axes.get_ylabel() for axes in track.plot().axes}
    assert {"factor b", "loss [%]", "rate [% of ΔL]"} <= labels
    assert track.plot("track").axes[0].get_title() == track.plot().axes[0].get_title()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"budget": 1.5}, "budget"),
        ({"budget_unit": "percent"}, "percent"),
        ({"rate_limit": "nowhere.json"}, "nowhere.json"),
        ({"min_factor": 0.0}, "min_factor"),
        ({"calm": 2.0}, "calm must lie in 0 to 1"),
        ({"solver": "magic"}, "magic"),
        ({"fps": -1.0}, "fps must be above 0"),
        ({"video": "nowhere.mp4"}, "nowhere.mp4"),
        ({"video": [np.zeros((8, 8))]}, "frame 0: .*pixel values of shape"),
        ({"video": [np.zeros((4, 4, 3))]}, "frame 0: a frame needs at least 8 x 8"),
        ({"video": np.zeros((8, 8, 3))}, "video is one frame"),
        ({"video": None}, "video must be a path"),
        ({"budget": "0.5"}, "budget must be a number"),
        ({"display": 3}, "display must be a preset's name, a path or a Display, got an int"),
        ({"jobs": -2}, "jobs must be a whole number"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"robust": ("relative", "castle")}, "robust must be true or false"),
        ({"robust": True, "measures": ["castle"]}, "two measures or more"),
        ({"measures": "castle,relative"}, "measures castle,relative is for `robust`, which is missing"),
        ({"robust": True, "measures": ["castle", 3]}, "measures must be names, got 3"),
        ({"others": "b.mp4"}, "others must be a list of videos"),
        ({"others": [3]}, "each of others must be a path"),
        ({"weights": 3}, "weights must be a path, got an int"),
        ({"weights": "gone.csv"}, "weights gone.csv: no such file"),
        ({"device": "tpu"}, "device must be one of cpu, gpu, auto"),
        ({"battery_wh": "big"}, "battery_wh must be a number"),
        ({"field_of_view": 200}, "field_of_view must lie in 0.1 to 175"),
    ],
)
def test_errors_name_the_argument(given: dict[str, object], says: str) -> None:
    arguments = {"video": scene(), "budget": 0.5, "fps": 2.0, **given}
    if "nowhere.mp4" in str(arguments["video"]):
        arguments["fps"] = None
    with pytest.raises(evenlight.InputError, match=says) as refused:
        evenlight.optimize(**arguments)  # type: ignore[arg-type] # wrong on purpose
    assert "--" not in str(refused.value)


def test_loss_curves_are_not_asked_for_again_with_other_arguments() -> None:
    curves = evenlight.loss_curves(scene(), fps=2.0, min_factor=0.1)
    assert evenlight.optimize(curves, 0.15).outcome.lowest_factor == pytest.approx(0.1)
    for given in (
        {"display": "nosuch"},
        {"min_factor": 0.4},
        {"fps": 3.0},
        {"field_of_view": 40},
    ):
        with pytest.raises(evenlight.InputError, match=f"{next(iter(given))}: loss curves were made"):
            evenlight.optimize(curves, 0.5, **given)
    with pytest.raises(evenlight.InputError, match="contrast_model is not the one"):
        evenlight.optimize(curves, 0.5, contrast_model="as-printed")


def test_every_option_of_the_command_is_a_keyword_with_its_default() -> None:
    """But for what Python has no use for: its own cache and the player's page."""
    keywords = dict(inspect.signature(evenlight.optimize).parameters)
    assert list(keywords)[:2] == ["video", "budget"]
    options = {one.name: one.default for one in dataclasses.fields(TrackRequest)}
    assert keywords.keys() - {"video"} == options.keys() - {"no_cache", "no_player"}
    for name, keyword in keywords.items() - {("video", keywords["video"]), ("budget", keywords["budget"])}:
        assert keyword.default == getattr(options[name], "value", options[name])
        assert f"\n{name} : " in (evenlight.optimize.__doc__ or "")


def test_choices_are_taken_by_their_values_and_as_members() -> None:
    named, by_value = (
        evenlight.optimize(scene()[:6], 0.5, fps=2.0, actuator=actuator, limit_curve=curve)
        for actuator, curve in (("pixels", "safe"), (evenlight.Actuator.PIXELS, LimitCurve.SAFE))
    )
    np.testing.assert_array_equal(named.factors, by_value.factors)


def test_clips_share_a_budget_with_weights_allowances_and_a_battery(tmp_path: Path) -> None:
    (tmp_path / "weights.csv").write_text("start_s,end_s,weight\n0,2,3\n")
    (tmp_path / "still.csv").write_text("start_s,end_s,allowance\n1,4,0\n")
    first = evenlight.optimize(
        scene(),
        0.5,
        fps=2.0,
        others=[scene(2)],
        weights=tmp_path / "weights.csv",
        allowances=str(tmp_path / "still.csv"),
        battery_wh=50.0,
    )
    (second,) = first.others
    assert np.concatenate([first.factors, second.factors]).mean() == pytest.approx(0.5, abs=1e-6)
    assert np.ptp(first.factors[1:8]) == pytest.approx(0, abs=1e-9)  # held from 1 s to 4 s, at 2 Hz
    assert first.outcome.weighted
    assert first.outcome.battery_capacity == 50.0
    assert second.others == ()


def test_an_earlier_track_is_what_another_starts_from(track: evenlight.Track, tmp_path: Path) -> None:
    track.save(tmp_path / "earlier")
    again = evenlight.optimize(track.curves, 0.5, start=tmp_path / "earlier")
    assert again.objective == pytest.approx(track.objective, rel=1e-3)


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("lowest_factor", "min_factor"), ("frames_per_second", "fps"), ("battery", "battery_wh")],
)
def test_another_name_is_told_the_right_one(wrong: str, right: str, command) -> None:
    for take in (evenlight.optimize, evenlight.loss_curves, evenlight.OnlineController):
        with pytest.raises(evenlight.InputError, match=f"{wrong}: it is called {right}"):
            take(scene(), 0.5, **{wrong: 2.0})  # type: ignore[operator] # wrong on purpose
    told = command("optimize", "sunrise", "--budget", 0.5, "--out", "o", f"--{wrong.replace('_', '-')}", 2)
    assert f"it is called --{right.replace('_', '-')}; see" in told.err
    with pytest.raises(TypeError, match=r"optimize\(\) got an unexpected keyword argument 'brightness'"):
        evenlight.optimize(scene(), 0.5, brightness=1)  # type: ignore[call-arg] # wrong on purpose


def test_tracks_can_be_kept_in_sets(track: evenlight.Track) -> None:
    assert len({track, track}) == 1


def test_factors_beyond_the_curves_are_refused(track: evenlight.Track) -> None:
    with pytest.raises(evenlight.InputError, match=r"factors must lie in 0\.2 to 1"):
        track.loss(0.1)
    with pytest.raises(evenlight.InputError, match="one for each of the 40 frames"):
        track.loss([0.5, 0.6])
    with pytest.raises(evenlight.InputError, match="no such folder"):
        evenlight.load("nowhere")


def test_what_is_gone_says_why(command) -> None:
    with pytest.raises(evenlight.InputError, match="tolerance: it is gone: every frame is counted whole"):
        evenlight.optimize(scene(), 0.5, tolerance=0.1)  # type: ignore[call-arg] # gone
    told = command("optimize", "sunrise", "--budget", 0.5, "--out", "o", "--tolerance", 0.1)
    assert "it is gone: every frame is counted whole; see" in told.err


def test_the_factor_of_a_time_is_that_of_the_frame_which_is_shown(track: evenlight.Track) -> None:
    assert list(track) == list(zip(track.times.tolist(), track.factors.tolist(), strict=True))
    at = track.factor_at([-1.0, 0.0, 0.49, 0.5, 19.6, 1e6])  # two frames a second, 40 of them
    np.testing.assert_array_equal(at, track.factors[[0, 0, 0, 1, 39, 39]])
    assert float(track.factor_at(0.5)) == track.factors[1]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_a_dimmed_frame_is_factor_times_its_luminance(track: evenlight.Track, kind: type) -> None:
    white = 1 if kind is np.float32 else np.iinfo(kind).max
    frame = (scene()[3] / 255 * white).astype(kind)
    dimmed = track.dim(frame, 1.7)
    assert (dimmed.dtype, dimmed.shape) == (frame.dtype, frame.shape)
    gamma = 1.95  # of the display of the paper
    by_definition = white * (track.factors[3] * (frame / white) ** gamma) ** (1 / gamma)
    np.testing.assert_allclose(dimmed, by_definition, atol=0.51 if kind is not np.float32 else 1e-6)
    for use in (lambda: track.dim(frame, np.nan), lambda: track.factor_at([0.0, np.nan])):
        with pytest.raises(evenlight.InputError, match=r"times? must be "):
            use()


def test_a_track_writes_its_dimmed_video_and_its_scripts(track: evenlight.Track, tmp_path: Path) -> None:
    film, script = tmp_path / "dimmed.mkv", tmp_path / "dim.lua"
    track.apply(scene(), film, fps=2.0)
    frames = list(evenlight.open_video(str(film)).frames())
    assert [frame.time for frame in frames] == pytest.approx(track.times, abs=1e-3)
    for frame, pixels in zip(frames[::13], scene()[::13], strict=True):
        expected = track.dim(pixels, frame.time).astype(float)
        assert (
            np.abs(frame.pixel_values * (255 / np.iinfo(frame.pixel_values.dtype).max) - expected).max() < 3
        )
    track.export("mpv", script)
    first = re.search(r"\n0\.000000 (0\.\d+)", script.read_text())
    assert first is not None
    assert float(first[1]) == pytest.approx(track.factors[0] ** (1 / 1.95), abs=1 / 2040)
    for again in (lambda: track.apply(scene(), film, fps=2.0), lambda: track.export("mpv", script)):
        with pytest.raises(evenlight.InputError, match="is there already; give `force`"):
            again()
    with pytest.raises(evenlight.InputError, match="other content"):
        track.apply(scene(2), tmp_path / "x.mkv", fps=2.0)
    with pytest.raises(evenlight.InputError, match="vlc"):
        track.export("vlc", script)


class OfAnotherLibrary:
    """An array that copies from its device only when told so."""

    def __init__(self, held: NDArray[np.uint8]) -> None:
        self.held = held

    def __array__(self, *_: object, **__: object) -> NDArray[np.uint8]:
        raise TypeError("implicit conversion is not allowed")

    def __dlpack__(self, **asked: object) -> object:
        return self.held.__dlpack__(**asked)  # type: ignore[call-overload]

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.held.__dlpack_device__()


def test_frames_of_other_libraries_and_layouts_are_taken_or_told_the_way(track: evenlight.Track) -> None:
    frame = scene()[0]
    display = evenlight.load_display("varjo-xr3")
    found = evenlight.frame_loss(OfAnotherLibrary(frame), 0.5, display=display)
    assert found == evenlight.frame_loss(frame, 0.5, display=display)
    for other, way in (
        (frame[..., 0], r"numpy\.stack\(\[frame\] \* 3, axis=-1\)"),
        (np.moveaxis(frame, -1, 0), r"numpy\.moveaxis\(frame, 0, -1\)"),
        (np.concatenate([frame, frame[..., :1]], axis=2), r"frame\[\.\.\., :3\]"),
    ):
        with pytest.raises(evenlight.InputError, match=way):
            evenlight.frame_loss(other, 0.5, display=display)

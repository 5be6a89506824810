"""The command `evenlight play`: a video with its brightness track, on a window."""

from __future__ import annotations

import enum
import functools
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.brightness_track import BudgetUnit
from evenlight.data_schema.errors import InputError
from evenlight.method.choices import Device, LimitCurve

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.rig import Rig
    from evenlight.experiments.measured_play import Measurement
    from evenlight.experiments.play_log import Pass
    from evenlight.experiments.playback import Playback

DEFAULT_PASSES = 3
INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal
FREE_RUNNING = 1.1  # times as many refreshes as the display makes


class Version(enum.Enum):
    """What is played."""

    OURS = "ours"  # by the track
    BASELINE = "baseline"  # constantly, at equal power
    BOTH = "both"  # one after the other
    FULL = "full"  # undimmed


def play(
    video: Annotated[
        str, typer.Argument(help="Video file, folder of images, or built-in sequence; a scene with --walk.")
    ],
    track: Annotated[
        Path | None, typer.Argument(help="Its track.csv, or the folder that holds it; none with --walk.")
    ] = None,
    version: Annotated[
        Version | None,
        typer.Option(help="By the track (if not given), constant at equal power, both in turn, undimmed."),
    ] = None,
    rig: Annotated[
        str | None, typer.Option(help="Rig: a toml file or a preset; else a window as large as the video.")
    ] = None,
    display: Annotated[
        str | None, typer.Option(help="Display: a preset or a toml file; else the rig's, or the track's.")
    ] = None,
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a track that was made for another display.")
    ] = False,
    size: Annotated[
        str | None, typer.Option(help="Size of a built-in sequence or a scene in pixels, as 640x360.")
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until escape.")] = False,
    label: Annotated[bool, typer.Option("--label", help="Say on the picture how it is dimmed.")] = False,
    log: Annotated[
        Path | None, typer.Option(help="File for flip times, frames, factors, drops: .csv or .jsonl.")
    ] = None,
    screenshots: Annotated[Path | None, typer.Option(help="Folder for a picture of the screen.")] = None,
    walk: Annotated[
        bool,
        typer.Option(
            "--walk", help="Walk in the scene house or school: W, A, S, D, arrows, mouse; shift hurries."
        ),
    ] = False,
    factor: Annotated[
        float | None, typer.Option(help="Brightness factor of a walk, to begin with; else 1, or by --budget.")
    ] = None,
    target_loss: Annotated[
        float | None,
        typer.Option(help="Contrast loss that a walk is dimmed to, online; with --budget to begin with."),
    ] = None,
    budget: Annotated[
        float | None, typer.Option(help="Budget that the target of a dimmed walk follows, in its unit.")
    ] = None,
    budget_unit: Annotated[
        BudgetUnit | None,
        typer.Option(help="Mean brightness factor, share of full power, or watt.", show_default="factor"),
    ] = None,
    horizon: Annotated[
        float | None,
        typer.Option(help="Seconds over which the mean is to meet the budget.", show_default="60"),
    ] = None,
    rate_limit: Annotated[
        str | None, typer.Option(help="Rate limit of a dimmed walk: a preset or a file; else the paper's.")
    ] = None,
    limit_curve: Annotated[
        LimitCurve | None, typer.Option(help="Of a dimmed walk: the fitted rate limit, or its safe edge.")
    ] = None,
    tuning: Annotated[
        Path | None, typer.Option(help="Gains of a dimmed walk: tuning.json of `evenlight control --tune`.")
    ] = None,
    device: Annotated[
        Device | None, typer.Option(help="What measures the loss of a dimmed walk; else what is fastest.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="File for the way walked, .json: a path that `render` takes.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="End a walk after so many seconds.")] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="As fast as it goes, on a clock that counts the refreshes.")
    ] = False,
    measure_power: Annotated[
        bool,
        typer.Option(
            "--measure-power",
            help="Measure the panel's power while ours, baseline and full are played in turn.",
        ),
    ] = False,
    passes: Annotated[
        int | None, typer.Option(help="How often each version is played for its power; else 3.", min=1)
    ] = None,
    sample_rate_hz: Annotated[
        float | None, typer.Option(help="Samples of the power meter per second; else up to 1000.", min=0.1)
    ] = None,
    sync_patch: Annotated[
        bool,
        typer.Option(
            "--sync-patch", help="A corner that changes with every frame, for a photodiode at the meter."
        ),
    ] = False,
    power_model: Annotated[
        str | None, typer.Option(help="Power model of a --budget, or to compare the measured power with.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for measured power, or for what dimmed a walk: samples, table, report."),
    ] = None,
    old_calibration_ok: Annotated[
        bool,
        typer.Option("--old-calibration-ok", help="Accept a display that was measured too long ago."),
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing of what is shown.")] = False,
) -> Path | None:
    """Show a video with its brightness track (keys: 1 ours, 2 baseline, 3 undimmed), or walk; escape ends."""
    of_power: dict[str, object] = {"--passes": passes, "--sample-rate-hz": sample_rate_hz, "--out": out}
    of_power |= {"--sync-patch": sync_patch, "--power-model": power_model}
    of_passes: dict[str, object] = {"--version": version, "--loop": loop, "--label": label, "--log": log}
    of_videos: dict[str, object] = {"TRACK": track, "--other-display-ok": other_display_ok}
    of_videos |= {"--measure-power": measure_power} | of_passes | of_power
    of_control: dict[str, object] = {"--rate-limit": rate_limit, "--device": device}
    of_control |= {"--limit-curve": limit_curve, "--tuning": tuning}
    of_walks: dict[str, object] = {"--factor": factor, "--record": record, "--seconds": seconds}
    of_budget: dict[str, object] = {"--budget-unit": budget_unit, "--horizon": horizon}
    of_walks |= {"--target-loss": target_loss, "--budget": budget} | of_budget | of_control
    if walk:
        del of_videos["--out"]
        if budget is None:
            _refuse(of_budget, "{} is for --budget, which is not given")
        else:
            del of_videos["--power-model"]
        if target_loss is None and budget is None:
            _refuse(of_control, "{} is for walks that are dimmed online: give it with --target-loss")
        else:
            del of_videos["--other-display-ok"]
        _refuse(
            of_videos, "--walk takes no {}, which is for videos; --record keeps the way, --factor dims it"
        )
        from evenlight.experiments.walk_request import (
            RATE_LIMIT,
            LiveRequest,
            WalkRequest,
            budget_asked,
            walk_as_asked,
        )

        measured_by = device or Device.AUTO
        live = LiveRequest(
            target_loss=target_loss,
            rate_limit=rate_limit or RATE_LIMIT,
            limit_curve=limit_curve or LimitCurve.FITTED,
            tuning=tuning,
            device=measured_by,
            out=out,
            other_display_ok=other_display_ok,
            budget=budget_asked(budget, budget_unit, horizon, power_model),
        )
        asked = WalkRequest(video, rig, display, size, factor, record, seconds, screenshots, simulate, live)
        said = walk_as_asked(asked)
        if not quiet:
            typer.echo(said)
        return None
    _refuse(of_walks, "{} is for walks through a scene: give it with --walk, or leave it out")
    if not measure_power:
        _refuse(of_power, "{} is for measured power: give it with --measure-power, or leave it out")
    if track is None:
        raise InputError("play needs a TRACK: the folder that `evenlight optimize` wrote, or its track.csv")
    from evenlight.experiments.calibration_age import require_young
    from evenlight.experiments.play_log import require_log_file
    from evenlight.experiments.play_request import playback_of, rig_of, video_of
    from evenlight.experiments.track_fit import load_track, require_display, require_fit

    if loop and simulate:
        raise InputError("--loop goes on until somebody presses escape, and with --simulate nobody does")
    if log is not None:
        require_log_file(log)
    loaded = load_track(track)
    source, pixels = video_of(video, loaded.track, size)
    require_fit(source, loaded.track)
    used, panel = rig_of(rig, display, loaded.track.header.display_name, pixels)
    if not other_display_ok:
        require_display(loaded.track, panel)
    if rig is not None and not simulate:
        require_young(panel, used.calibration_age_limit, accepted=old_calibration_ok)
    if measure_power:
        _refuse(of_passes, "{} does not go with --measure-power, which plays every version in turn")
        from evenlight.experiments.measured_play import Measurement, require_output, require_power_meter
        from evenlight.method.preset_files import load_power_model

        require_power_meter(used, sync_patch=sync_patch)
        if power_model is not None:
            model = load_power_model(power_model)  # a slip is told before anything is played
            if not simulate:
                require_young(model, used.calibration_age_limit, accepted=old_calibration_ok)
        measurement = Measurement(
            folder=require_output(out),
            sample_rate=sample_rate_hz,
            passes=passes or DEFAULT_PASSES,
            sync_patch=sync_patch,
            track_sha256=loaded.sha256,
            simulated=simulate,
        )
        playback = replace(playback_of(source, loaded, ("ours",)), screenshots=screenshots)
        return _measure(playback, used, panel, measurement, quiet)
    version = version or Version.OURS
    if not quiet and version in (Version.BASELINE, Version.BOTH):
        typer.echo(f"baseline: constant factor {loaded.baseline:.4g}, {loaded.source_of_baseline}")
    versions = ("ours", "baseline") if version is Version.BOTH else (version.value,)
    playback = playback_of(source, loaded, versions)
    playback = replace(playback, loop=loop, captions=label, screenshots=screenshots)
    _play(playback, used, panel, _How(simulate, rig is None, quiet, log))
    return None


def play_command(write_power: Callable[[Path, str | None], list[str]]) -> Callable[..., None]:
    """Return the command `play`, which hands the folder of measured power to an analysis.

    Parameters
    ----------
    write_power : callable
        Writes the results into the folder, beside the prediction of a power model if one is named, and
        returns what is to be said of them.
    """

    @functools.wraps(play)
    def play_then_analyse(**asked: Any) -> None:
        folder = play(**asked)
        if folder is None:
            return
        said = write_power(folder, asked["power_model"])
        if not asked["quiet"]:
            for line in said:
                typer.echo(line)

    return play_then_analyse


def _measure(playback: Playback, rig: Rig, display: Display, measurement: Measurement, quiet: bool) -> Path:
    """Play every version in turn and record the power; return the folder."""
    from evenlight.data_schema.append_rows import AppendedRows
    from evenlight.data_schema.dataset_layout import BACKLIGHT_SETTINGS
    from evenlight.data_schema.power_log import BacklightSetting
    from evenlight.experiments.measured_play import play_measured, with_passes
    from evenlight.experiments.playback import Player, open_devices

    playback = with_passes(playback, measurement.passes)
    turn = 0

    def say(words: str) -> None:
        nonlocal turn
        turn += 1
        if not quiet:
            typer.echo(f"measuring {words}, {turn} of {len(playback.order)}")

    folder, rows = measurement.folder, None
    try:
        with ExitStack() as stack:
            if rig.backlight != "none":
                rows = stack.enter_context(AppendedRows(folder / BACKLIGHT_SETTINGS, BacklightSetting))
            noted = None if rows is None else lambda setting: rows.append([setting], to_disk=False)
            opened = open_devices(rig, display, simulated=measurement.simulated, any_rate=False, noted=noted)
            devices = stack.enter_context(opened)
            player = Player(devices, playback, say)
            whole = play_measured(devices, player, playback, measurement)
    except BaseException as error:
        if isinstance(error, Exception | SystemExit):
            raise
        print(
            f"evenlight: interrupted; `evenlight fit {folder} --out FOLDER` analyses what was recorded",
            file=sys.stderr,
        )
        sys.exit(INTERRUPTED if isinstance(error, KeyboardInterrupt) else TERMINATED)
    if not whole:
        print("evenlight: ended before its end; what was measured until then follows", file=sys.stderr)
    return measurement.folder


def _refuse(options: Mapping[str, object], because: str) -> None:
    """Refuse the first option that was given, in words that have room for its name."""
    for name, given in options.items():
        if given is not None and given is not False:
            raise InputError(because.format(name))


@dataclass(frozen=True, slots=True)
class _How:
    """How it is played: on a clock of flips, at any refresh rate, silently, with a log."""

    simulate: bool
    any_rate: bool
    quiet: bool
    log: Path | None


def _play(playback: Playback, rig: Rig, display: Display, how: _How) -> None:
    """Play, and say how it went; whatever ends it, the log is written."""
    from evenlight.experiments.play_log import write_log
    from evenlight.experiments.playback import Player, open_devices

    def say(words: str) -> None:
        if not how.quiet:
            typer.echo(f"showing {words}")

    with open_devices(rig, display, simulated=how.simulate, any_rate=how.any_rate) as devices:
        player = Player(devices, playback, say)
        try:
            whole = player.play()
        finally:
            if how.log is not None and player.passes:
                write_log(how.log, player.passes, devices.rig.refresh_rate)
    if not how.quiet:
        for one in player.passes:
            typer.echo(_said(one, playback, devices.rig.refresh_rate))
        if not whole:
            typer.echo("ended before its end")


def _said(one: Pass, playback: Playback, refresh_rate: float) -> str:
    """Return how a pass went, in one line."""
    shown = one.shown
    names = " and ".join(dict.fromkeys(one.versions))
    words = (
        f"{playback.video.name}, {names}: {len(set(shown.video_frames))} of {len(playback.times)} frames in "
        f"{len(shown.flip_times)} refreshes at {refresh_rate:.4g} Hz, {shown.frames_dropped} dropped"
    )
    seconds = shown.flip_times[-1] + 1 / refresh_rate
    if len(shown.flip_times) > FREE_RUNNING * seconds * refresh_rate:
        words += " (the flips waited for no display)"
    if not shown.probe_luminance:
        return words
    pairs = zip(shown.probe_luminance, shown.probe_intended, strict=True)
    error = max(abs(drawn - intended) for drawn, intended in pairs)
    return (
        f"{words}; luminance read back {len(shown.probe_luminance)} times, off by {error:.2g} cd/m^2 at most"
    )

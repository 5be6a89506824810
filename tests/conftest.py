"""What several test files need: loss curves with known shape, and problems posed on them."""

import functools
import gc
import importlib.util
import io
import math
import os
import shutil
import signal
import subprocess
import time
import types
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import typer
from _pytest.runner import runtestprotocol
from example_tracks import example_track, header_of
from hypothesis import settings
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from PIL import Image

from evenlight import command as command_line
from evenlight import progress
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, write_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.optimizer.optimize import Problem, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_display, load_power_model
from evenlight.stimuli.sequence_format import on_grid
from evenlight.stimuli.sequences import is_sequence
from evenlight.stimuli.video_writer import write_video

# Several tests run at once, and more threads of each would only wait for cores. It counts for the processes
# that are started from here, those that run the tests among them.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Dask's profiler can stop a process for ever on Python 3.11 (python/cpython#106883).
os.environ["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = "false"

# Tests find no loss curves of earlier ones, but for those that are about that.
os.environ["EVENLIGHT_CURVES_CACHE_MB"] = "0"

# Mesa compiles shaders once, also for tests that have a cache of their own.
os.environ.setdefault(
    "MESA_SHADER_CACHE_DIR", os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
)

# It imports what a session needs, warnings of PsychoPy and all, and is run by processes of its own.
collect_ignore = ["companions/warm_modules.py"]

TESTS = Path(__file__).parent
# Files that take half a minute and more, of a processor or of waiting.
LONG = {
    "test_every_command.py", "test_help_examples.py", "test_runtime_tree.py", "test_headset_sessions.py",
    "test_viewing_sessions.py", "test_drivers.py", "test_fit_command.py", "test_recovery.py",
    "test_reproduce_command.py",
}  # fmt: skip
# What `make test-fast` leaves out: commands from end to end, simulated studies, timings; files that take over
# 1.2 s of a processor, start PsychoPy or compile shaders; elsewhere tests of over 0.3 s, marked `slow`.
SLOW_FOLDERS = ("pipeline", "recovery", "benchmarks")
SLOW_FILES = {
    "test_answers_follow_the_track.py", "test_calibration.py", "test_calibration_figures.py",
    "test_clip_player.py", "test_cluster.py", "test_cumulative_link.py", "test_ddc_backlight.py",
    "test_drift.py", "test_drivers.py", "test_every_command.py", "test_exports.py", "test_eye_renderer.py",
    "test_fit_command.py", "test_fit_measure.py", "test_fit_report.py", "test_forms_of_loss.py",
    "test_gpu_curves.py", "test_gpu_device.py", "test_headset_playback.py", "test_headset_sessions.py",
    "test_headset_walk.py", "test_help_examples.py", "test_image_renderer.py", "test_integrity_gate.py",
    "test_joint_fit.py", "test_limit_models.py", "test_live_view.py", "test_loss_meters.py",
    "test_mutated_files.py", "test_nordic_ppk2.py", "test_objectives.py", "test_odd_films.py",
    "test_optimize.py", "test_paper_audit.py", "test_pixel_floor.py", "test_planning.py",
    "test_player_content.py", "test_pointer.py", "test_power_board.py", "test_power_links.py",
    "test_power_table.py", "test_random_threshold.py", "test_rating_findings.py", "test_report.py",
    "test_ring_scene.py", "test_robust.py", "test_scene_antialiasing.py", "test_scene_content.py",
    "test_scene_feed.py", "test_scene_light.py", "test_scene_rays.py", "test_scene_sequences.py",
    "test_search_findings.py", "test_sequences.py", "test_setup.py", "test_simulate_viewing.py",
    "test_stereo.py", "test_stereo_rings.py", "test_sweep_results.py", "test_tables.py", "test_track.py",
    "test_track_exports.py", "test_track_figure.py", "test_validation.py", "test_viewing_plan.py",
    "test_window.py", "test_window_stage.py",
}  # fmt: skip


def pytest_configure(config: pytest.Config) -> None:
    """Let each process import the folders of tests in another order: each compiles its share for all."""
    worker = getattr(config, "workerinput", None)
    if worker and config.args_source is pytest.Config.ArgsSource.TESTPATHS:
        folders = sorted({str(path.parent) for path in TESTS.glob("*/test_*.py")})
        begin = len(folders) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        config.args[:1] = folders[begin:] + folders[:begin]


def pytest_collection_finish() -> None:
    """Spare the garbage collector what lives as long as the process: a hundred thousand items and modules."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(5000, 10, 20)


def is_slow(path: Path) -> bool:
    return path.parent.name in SLOW_FOLDERS or path.name in SLOW_FILES


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no slow file where slow tests are not run."""
    return True if "not slow" in config.option.markexpr and is_slow(collection_path) else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what `make test-fast` leaves out.

    Long files come first, so that no process is left with one at the end.
    """
    items.sort(key=lambda item: (TESTS not in item.path.parents, item.path.name not in LONG, item.path))
    for item in items:
        if is_slow(item.path):
            item.add_marker(pytest.mark.slow)


MOST_TRIES = 3  # of a test marked `real_time`
TRIED = "tried again"


def is_worth_another_try(failed: pytest.TestReport) -> bool:
    """Whether a failure may be for want of time: not where the test could not be set up, and not a hang.

    A hang has used up the time-out of all its tries.
    """
    return failed.when == "call" and "Timeout (>" not in failed.longreprtext


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Try a failed test that is about real time again, with fixtures, screens and processes of its own.

    What a busy machine does to it is no failure of what it is about; the run's end says that it was done.
    """
    if item.get_closest_marker("real_time") is None:
        return None
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    for tries in range(1, MOST_TRIES + 1):
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        failed = [report for report in reports if report.failed]
        if not failed or tries == MOST_TRIES or not is_worth_another_try(failed[0]):
            break
        lines = failed[0].longreprtext.splitlines()
        item.user_properties.append(
            (TRIED, next((line for line in lines if line.startswith("E ")), lines[-1]))
        )
        item.session._setupstate.teardown_exact(None)  # fixtures of modules and of the session too
    for report in reports:
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests of real time were tried again, and why."""
    for report in [*terminalreporter.getreports("passed"), *terminalreporter.getreports("failed")]:
        if report.when == "call":
            for name, why in report.user_properties:
                if name == TRIED:
                    terminalreporter.write_line(f"TRIED AGAIN {report.nodeid} - {why}")


# A busy machine is no failure; pytest's own timeout ends what hangs.
# The same examples in each run, so that a change is blamed for what it did; `make studies` draws others.
settings.register_profile("evenlight", deadline=None, derandomize=True)
settings.register_profile("random", deadline=None, derandomize=False)
settings.load_profile("evenlight")


def weber_limit(relative_rate: float) -> RateLimit:
    """A constant share of the luminance per second: ln rate = ln k + ln L, a line in log-log."""
    low, high = 0.01, 1000.0
    middle, half = (np.log(high) + np.log(low)) / 2, (np.log(high) - np.log(low)) / 2
    display = load_display("varjo-xr3")
    return RateLimit(
        "weber",
        display.name,
        display.fingerprint,
        RateLimitForm.LOG_LOG,
        (float(np.log(relative_rate) + middle), float(half)),
        (low, high),
    )


def power_curves(
    strength: ArrayLike,
    exponent: ArrayLike = 1.0,
    luminance: ArrayLike = 50.0,
    frames_per_second: float = 25.0,
    knots: int = 33,
) -> LossCurves:
    """Loss curves strength · (1 - b)^exponent: known in closed form, falling to 0 at b = 1."""
    strengths = np.atleast_1d(np.asarray(strength, dtype=float))
    n = len(strengths)
    factors = np.linspace(0.2, 1.0, knots)
    exponents = np.broadcast_to(np.asarray(exponent, dtype=float), (n,))
    mean = np.broadcast_to(np.asarray(luminance, dtype=float), (n,))
    return LossCurves(
        video="made",
        display=load_display("varjo-xr3"),
        times=np.arange(n) / frames_per_second,
        durations=np.full(n, 1 / frames_per_second),
        factors=factors,
        loss=strengths[:, None] * (1 - factors) ** exponents[:, None],
        visible_contrast=np.full(n, 0.5),
        mean_luminance=mean,
        channel_means=np.repeat(np.clip(mean / 104.4, 0, 1)[:, None], 3, axis=1),
        provenance=Provenance(),
    )


def mean_factor_problem(curves: LossCurves, budget: float, relative_rate: float = 0.03) -> Problem:
    """The problem of a mean factor under a constant relative rate limit."""
    power = load_power_model("surace2025")
    return pose(curves, Request(budget, BudgetUnit.FACTOR, power, weber_limit(relative_rate)))


@pytest.fixture(scope="session")
def make_curves() -> Callable[..., LossCurves]:
    return power_curves


@pytest.fixture(scope="session")
def make_problem() -> Callable[..., Problem]:
    return mean_factor_problem


@pytest.fixture(scope="session")
def make_weber_limit() -> Callable[[float], RateLimit]:
    return weber_limit


def write_stimulus(
    folder: Path, factors: ArrayLike, at_half: float = 0.2, frames_per_second: float = 5.0
) -> None:
    """Write what `evenlight optimize` would, of a gray video whose loss falls linearly to 0 at factor 1."""
    b = np.asarray(factors, dtype=float)
    n, one, display = len(b), np.ones(len(b)), load_display("varjo-xr3")
    times, full, knots = np.arange(n) / frames_per_second, np.full(n, 40.0), np.array([0.2, 1.0])
    curves = LossCurves(
        video=folder.name, display=display, times=times, durations=one / frames_per_second, factors=knots,
        loss=np.outer(one, at_half * (1 - knots) / 0.5), visible_contrast=one / 2, mean_luminance=full,
        channel_means=np.full((n, 3), 0.4), provenance=Provenance(),
    )  # fmt: skip
    wide = 90.0 if is_sequence(folder.name) else None
    header = header_of(display, video=folder.name, field_of_view=wide)
    loss = at_half * (1 - b) / 0.5
    columns = {"contrast_loss": loss, "mean_luminance": full * b, "rate_limit": one, "power": one}
    track = example_track(b, frames_per_second, header, **columns)
    words = dict.fromkeys(
        ("rate_limit", "power_model", "limit_curve", "modulated", "contrast_model", "solver"), "x"
    )
    numbers = dict.fromkeys(
        ("budget", "achieved", "objective", "objective_baseline", "mean_contrast_loss",
         "mean_contrast_loss_baseline", "mean_power", "baseline_power", "full_power", "pixels_per_degree",
         "solve_s", "curves_s", "bound_s", "max_rate_ratio"), 1.0,
    )  # fmt: skip
    summary = OptimizationSummary(
        video=folder.name, display=display.name, frames=n, duration=n / frames_per_second,
        budget_unit=BudgetUnit.FACTOR, mean_factor=float(b.mean()), baseline_factor=float(b.mean()),
        lowest_factor=0.2, lower_bound=0.0, simulated=False, frames_without_contrast=0, iterations=1,
        calm=0.0, seed=None, versions={}, provenance=Provenance(), **words, **numbers,
    )  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    write_track(folder / "track.csv", track)
    write_loss_curves(folder / "loss_curves.npz", curves)
    write_json_record(folder / "summary.json", summary)


def write_gray_video(
    path: Path, pixel_values: ArrayLike, size: tuple[int, int], frames_per_second: float
) -> None:
    """Write a lossless video of gray frames with a darker bar across."""
    width, height = size
    frames = []
    for k, value in enumerate(np.asarray(pixel_values, dtype=float)):
        pixels = np.full((height, width, 3), on_grid(min(value, 1.0)), dtype=np.uint16)
        pixels[height // 3 : height // 2] = on_grid(min(value, 1.0) / 2)
        frames.append(Frame(k / frames_per_second, 1 / frames_per_second, pixels))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_video(path, iter(frames), frames_per_second, bits=10)


@pytest.fixture(autouse=True, scope="session")
def prompt_sockets() -> None:
    """Let pyserial close a socket sooner: it sleeps 0.3 s each time, for servers that are far away."""
    from serial.urlhandler import protocol_socket

    protocol_socket.time = types.SimpleNamespace(time=time.time, sleep=lambda seconds: time.sleep(0.03))


@pytest.fixture(scope="session")
def short_ramps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A design for tests that are about what else a fit does: 5 levels, 120 ramps and 30 catch trials."""
    path = tmp_path_factory.mktemp("short_ramps") / "short.design.toml"
    path.write_text('screens = ["white"]\nrepetitions = 3\ncatch_share = 0.2\n')
    return path


@pytest.fixture(scope="session")
def make_stimulus() -> Callable[..., None]:
    return write_stimulus


@pytest.fixture(scope="session")
def make_video() -> Callable[..., None]:
    return write_gray_video


@dataclass(frozen=True)
class Outcome:
    """What a run of the command ended with."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session", autouse=True)
def coarse_pictures() -> Iterator[None]:
    """Write pictures of a fifth of their resolution: no test counts their pixels, and it is quicker.

    Where matplotlib draws them, for modules have the functions of `figure_style` under names of their own.
    """
    drawn = Figure.savefig

    def coarsely(figure: Figure, stream: io.BytesIO, **options: object) -> None:
        figure.set_dpi(40)
        drawn(figure, stream, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", coarsely)
        yield


@pytest.fixture(scope="module")
def blank_pictures() -> Iterator[None]:
    """Write an empty picture in place of each, where a command that draws the same is tested elsewhere."""
    stream = io.BytesIO()
    Image.new("L", (8, 8)).save(stream, format="PNG")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", lambda _, there, **__: there.write(stream.getvalue()))
        yield


@pytest.fixture(autouse=True, scope="session")
def heeded_interruptions() -> None:
    """Let processes heed Ctrl-C where a shell started the tests in the background: it has them ignore it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True, scope="session")
def command_line_put_together_once() -> Iterator[None]:
    """Let runs of `evenlight` in this process share its command line: to put it together takes 50 ms."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.main, "get_command", functools.cache(typer.main.get_command))
        yield


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Run `evenlight` with some arguments, in this process; on a slow machine too it tells no progress."""
    monkeypatch.setattr(progress, "INTERVAL", math.inf)

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            command_line.main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Outcome(int(ended.value.code or 0), out, err)

    return run


@pytest.fixture(scope="session")
def bare_screen() -> Iterator[Callable[[int], str]]:
    """Start a virtual screen of 24 or 30 bits where there is none yet, and return its DISPLAY."""
    running: dict[int, tuple[subprocess.Popen[str], str]] = {}

    def display(depth: int = 24) -> str:
        if depth not in running:
            if shutil.which("Xvfb") is None:
                pytest.fail("Xvfb is missing: on Debian, apt-get install xvfb libgl1-mesa-dri")
            server = subprocess.Popen(
                ["Xvfb", "-displayfd", "1", "-screen", "0", f"1280x800x{depth}", "-nolisten", "tcp"],
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
            assert server.stdout is not None
            running[depth] = (server, server.stdout.readline().strip())  # comes when it is ready
        return f":{running[depth][1]}"

    yield display
    for server, _ in running.values():
        server.terminate()
        server.wait()
        assert server.stdout is not None
        server.stdout.close()


WITHOUT_PSYCHOPY = "PsychoPy is missing, sessions in a window are not tested: `make lab`, Python 3.11 or 3.12"


@pytest.fixture(scope="session")
def psychopy_is_here() -> None:
    """Skip what opens a window of a session where PsychoPy is missing; it has no Python 3.13."""
    if importlib.util.find_spec("psychopy") is None:
        pytest.skip(WITHOUT_PSYCHOPY)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Let all tests that lack PsychoPy share one line at the end."""
    report = yield
    if report.skipped and isinstance(report.longrepr, tuple) and WITHOUT_PSYCHOPY in report.longrepr[2]:
        report.longrepr = (__file__, 1, report.longrepr[2])
    return report


@pytest.fixture(scope="session")
def virtual_screen(psychopy_is_here: None, bare_screen: Callable[[int], str]) -> Callable[[int], str]:
    """Start a virtual screen for a window of PsychoPy, and return its DISPLAY."""
    return bare_screen

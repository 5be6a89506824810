"""What several test files need: loss curves with known shape, and problems posed on them."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import ArrayLike

import evenlight
from data_schema.brightness_track import BudgetUnit
from data_schema.loss_curves import LossCurves
from data_schema.provenance import Provenance
from data_schema.rate_limit import RateLimit, RateLimitForm
from method.optimize import Problem, Request, pose
from method.preset_files import load_display, load_power_model

# A busy machine is no failure; pytest's own timeout ends what hangs.
settings.register_profile("evenlight", deadline=None)
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


@dataclass(frozen=True)
class Outcome:
    """What a run of the command ended with."""

    code: int
    out: str
    err: str


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Run `evenlight` with some arguments, in this process."""

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        with pytest.raises(SystemExit) as ended:
            evenlight.main([str(a) for a in arguments])
        out, err = capsys.readouterr()
        return Outcome(int(ended.value.code or 0), out, err)

    return run


@pytest.fixture(scope="session")
def virtual_screen() -> Iterator[Callable[[int], str]]:
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

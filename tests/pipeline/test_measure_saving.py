"""`evenlight measure saving`: both versions in turn on a device that plays them, and what is told of it."""

import itertools
import json
import math
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulators.ours import attach

from evenlight.analysis.played_power.device_saving import device_saving
from evenlight.analysis.played_power.pass_power import PassComparison
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.data_schema.recordings.played_power import DevicePass, DeviceSaving
from evenlight.data_schema.storage.tables import read_rows, write_rows
from evenlight.hardware import device_passes
from evenlight.hardware.device_passes import PassRequest, _started, measure_passes
from evenlight.hardware.measuring import Bench, bench_for
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock

FILMS = ("--full", "bikes.mp4", "--dimmed", "bikes-dimmed.mp4")
VERSIONS = ["dimmed", "full"]
LATE = 0.15  # [s] after which the gauge shows a new load
# A player, and a gauge that shows the new load when it is told that it is time.
PLAYER = """
import sys, time
from pathlib import Path
folder = Path({folder!r})
(folder / "played").open("a").write(sys.argv[1] + "\\n")
while not (folder / "late").exists():
    time.sleep(0.005)
(folder / "next").write_text({{"bright": "1000000", "dim": "800000"}}[sys.argv[1]])
(folder / "next").replace(folder / "current_now")
(folder / "late").unlink()
time.sleep(600)
"""


class LaptopsClock(WaitingClock):
    """The laptop's time, which passes only where it is waited for; in a pass the gauge follows `LATE`."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder, self.begun = folder, math.inf

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        if self.now() >= self.begun + LATE:
            self.begun = math.inf
            (self._folder / "late").touch()
            end = time.monotonic() + 200
            while (self._folder / "late").exists():
                assert time.monotonic() < end
                time.sleep(0.005)


@pytest.fixture
def clock(laptop: Path, monkeypatch: pytest.MonkeyPatch) -> LaptopsClock:
    own = LaptopsClock(laptop)
    monkeypatch.setattr(device_passes, "bench_for", lambda name: Bench(own.now, own.wait, None, timed=True))
    return own


@pytest.fixture
def laptop(tmp_path: Path) -> Path:
    """The folder of a battery, 10 V, and a player `play.py` in it."""
    folder = tmp_path / "BAT0"
    folder.mkdir()
    for name, text in {"status": "Discharging", "voltage_now": "10000000", "current_now": "1000000"}.items():
        (folder / name).write_text(f"{text}\n")
    (folder / "play.py").write_text(PLAYER.format(folder=str(folder)))
    return folder


def asked(laptop: Path, settle: float, rounds: int = 2, play: str = "") -> PassRequest:
    play = play or f"{sys.executable} -I -S {laptop}/play.py {{film}}"
    films = {"full": "bright", "dimmed": "dim"}
    return PassRequest(f"battery:{laptop}", films, rounds, settle + 0.5, settle, 20.0, play)


def samples_in(folder: Path, *powers: float) -> None:
    rows = [PowerSample(k, float(k), float(k), power) for k, power in enumerate(powers)]
    write_rows(folder / "power.csv", PowerSample, rows)
    (folder / "passes.csv").touch()


def measured(request: PassRequest, folder: Path) -> DeviceSaving:
    passes, apparatus = measure_passes(request, folder, lambda words: "", lambda line: None)
    return device_saving(passes, request, apparatus, folder)


def test_a_simulated_device_saves_what_its_panel_does(command: Any, tmp_path: Path) -> None:
    """By hand: the panel takes 0.2945 W and 0.001858 W m²/cd; from 200 to 120 cd/m² that is 22.3 % less."""
    out = tmp_path / "power"
    done = command("measure", "saving", "--instrument", "simulated", *FILMS, "--rounds", "4", "--out", out)
    assert done.code == 0
    words = (
        r"SIMULATED: the dimmed version saves 22\.[34] % of the device's power \(95 % confidence interval 22"
    )
    assert re.search(words, done.out)
    saving = json.loads((out / "saving.json").read_text())
    assert saving["saving_percent"] == pytest.approx(100 * 80 * 0.001858 / (0.2945 + 200 * 0.001858), abs=0.2)
    assert saving["saving_percent_ci_low"] < saving["saving_percent"] < saving["saving_percent_ci_high"]
    assert saving["simulated"]
    assert sorted(one["version"] for one in saving["passes"]) == sorted(VERSIONS * 4)
    assert (out / "saving.png").read_bytes()[:4] == b"\x89PNG"
    passes = read_rows(DevicePass, out / "passes.csv")
    assert [one.duration for one in passes] == [105.0] * 8  # 120 s, less 15 s to settle
    assert len(read_rows(PowerSample, out / "power.csv")) >= 8 * 120
    assert command("validate", out).code == 0


def test_it_measures_an_emulated_phone(command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    attach(monkeypatch)
    words = ("--rounds", "2", "--seconds", "4", "--settle-s", "0.1", "--rate-hz", "20")
    out = tmp_path / "power"
    done = command("measure", "saving", "--instrument", "simulated:adb", *FILMS, *words, "--out", out)
    assert done.code == 0, done.err
    assert json.loads((out / "saving.json").read_text())["saving_percent"] == pytest.approx(22.3, abs=1.0)


def test_a_program_plays_each_version_and_what_the_gauge_shows_late_does_not_count(
    laptop: Path, clock: LaptopsClock, tmp_path: Path
) -> None:
    """10 W and 8 W: 20 %, as the first 0.3 s of each pass are left out."""
    request = asked(laptop, 0.3)

    def begin(line: str) -> None:
        clock.begun = clock.now()  # a line is told before the first pass, and after each

    passes, apparatus = measure_passes(request, tmp_path / "out", input, begin)
    saving = device_saving(passes, request, apparatus, tmp_path / "out")
    assert (laptop / "played").read_text().split() == [request.films[version] for version in request.order()]
    assert saving.saving_percent == pytest.approx(20.0)
    assert saving.full_power == pytest.approx(10.0)
    assert not saving.simulated
    assert any("one value for up to" in note and "--settle-s of at least" in note for note in saving.notes)


def test_a_person_is_asked_to_start_each_version(laptop, clock, tmp_path) -> None:
    questions = []
    request = PassRequest(f"battery:{laptop}", {"full": "a.mp4", "dimmed": "b.mp4"}, 2, 0.5, 0.0, 20.0, "")
    passes, _ = measure_passes(request, tmp_path / "out", lambda words: questions.append(words) or "", print)
    films = [request.films[version] for version in request.order()]
    assert [words.partition(": ")[2].split()[1] for words in questions] == films
    assert all("press Enter when it runs" in words for words in questions)
    assert device_saving(passes, request, {}, tmp_path / "out").saving_percent == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("--seconds", "20", "--settle-s", "15"),
            "needs 10 samples that count; 20 s, less 15 s to settle, have 5",
        ),
        (("--play", "true film.mp4"), "say with {film} where the film goes"),
        (("--play", "no-such-player {film}"), "there is no program 'no-such-player'"),
        (("--play", "true '{film}"), "No closing quotation"),
        (("--instrument", "adb:@/nowhere/adb"), "no program '/nowhere/adb'; install it"),
        (("--instrument", "batery:BAT0"), "did you mean 'battery'"),
        (("--instrument", "simulated", "--rounds", "1"), "--rounds"),
        (("--instrument", "simulated", "--seconds", "inf"), "--seconds"),
        (("--instrument", "simulated", "--rate-hz", "nan"), "--rate-hz"),
    ],
)
def test_what_cannot_be_measured_is_refused_and_leaves_nothing(command: Any, tmp_path, words, told) -> None:
    out = tmp_path / "power"
    words = words if "--instrument" in words else (*words, "--instrument", "simulated")
    done = command("measure", "saving", *FILMS, *words, "--out", out)
    assert done.code == (1 if "/nowhere" in told else 2)
    assert told in done.err
    assert "Traceback" not in done.err
    assert not out.exists()


def test_without_a_person_or_a_player_nothing_is_made(laptop, tmp_path) -> None:
    def nobody(words: str) -> str:
        raise EOFError

    request = PassRequest(f"battery:{laptop}", {"full": "a", "dimmed": "b"}, 2, 0.6, 0.0, 20.0, "")
    with pytest.raises(InputError, match="no one pressed Enter; give --play"):
        measure_passes(request, tmp_path / "out", nobody, print)
    assert not (tmp_path / "out").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes").touch()
    with pytest.raises(InputError, match="holds something already; give a new folder"):
        measure_passes(request, tmp_path / "full", nobody, print)


def test_a_player_that_fails_ends_it(laptop, tmp_path) -> None:
    with pytest.raises(InputError, match=r"--play: false (bright|dim) ended with the code 1"):
        measured(asked(laptop, 0.0, play="false {film}"), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_a_players_script_has_started_ends_with_it(laptop) -> None:
    request = asked(laptop, 0.0, play=f"sh -c 'sleep 30 & echo $! > {laptop}/pid; wait; : {{film}}'")
    with _started(request, "full", bench_for(request.instrument), "", input):
        while not (laptop / "pid").exists() or not (laptop / "pid").read_text():
            time.sleep(0.01)
    state = Path("/proc") / (laptop / "pid").read_text().strip() / "stat"
    end = time.monotonic() + 200  # a busy computer takes a moment to end what was killed
    while state.exists() and state.read_text().split()[2] != "Z":
        assert time.monotonic() < end
        time.sleep(0.01)


def test_steps_of_a_gauge_widen_an_interval_that_would_have_no_width(tmp_path) -> None:
    """By hand: steps of 0.1 W at 1.1 and 1.0 W; 1.96 * 0.1/sqrt(12) * sqrt(1 + (1/1.1)^2) / 1.1 is 6.95 %."""
    samples_in(tmp_path, 1.0, 1.1)
    request = PassRequest("adb:", {"full": "a", "dimmed": "b"}, 2, 100.0, 0.0, 1.0, "")
    passes = [
        DevicePass(k, name, 100.0 * k, 100.0, 1.1 if name == "full" else 1.0, 100, 0, 1.0)
        for k, name in enumerate(request.order())
    ]
    found = device_saving(passes, request, {}, tmp_path)
    assert (found.ci_high - found.ci_low) / 2 == pytest.approx(6.95, abs=0.01)
    assert found.ci_low < 100 * (1 - 1 / 1.0833) < found.ci_high
    assert "steps of 0.1 W" in found.notes[0]


def test_a_meter_at_0_w_is_an_error_in_words(laptop, clock, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("evenlight.hardware.drivers.polled_power.drawn_power", lambda *words: 0.0)
    request = PassRequest(f"battery:{laptop}", {"full": "a", "dimmed": "b"}, 2, 0.5, 0.0, 20.0, "")
    with pytest.raises(InstrumentError, match="0 W over a pass"):
        measure_passes(request, tmp_path / "out", lambda words: "", print)
    assert not (tmp_path / "out").exists()


def test_a_wild_sample_is_left_out_and_named(laptop, clock, tmp_path, monkeypatch) -> None:
    """Every eighth reading of a steady 1 W is 49.5 W: the mean of the rest is 1 W, a saving of nothing."""
    readings = itertools.count()
    monkeypatch.setattr(
        "evenlight.hardware.drivers.polled_power.drawn_power",
        lambda *words: 49.5 if next(readings) % 8 == 5 else 1.0,
    )
    request = PassRequest(f"battery:{laptop}", {"full": "a", "dimmed": "b"}, 2, 1.0, 0.0, 20.0, "")
    lines: list[str] = []
    passes, _ = measure_passes(request, tmp_path / "out", lambda words: "", lines.append)
    assert [one.mean_power for one in passes] == pytest.approx([1.0] * 4)
    assert all(one.n_wild >= 1 for one in passes)
    assert any("49.5 W" in line and "left out" in line and "median of 1 W" in line for line in lines)
    found = device_saving(passes, request, {}, tmp_path / "out")
    assert "left out (pass 0, 1, 2, 3, from 0)" in found.notes[0]


@pytest.mark.parametrize(("after", "enough"), [(5, True), (2, False)])
def test_ended_early_it_tells_of_what_was_measured_if_that_is_enough(tmp_path, after, enough) -> None:
    request = PassRequest("simulated", {"full": "a", "dimmed": "b"}, 4, 30.0, 5.0, 1.0, "")

    def stop(line: str) -> None:
        if line.startswith(f"pass {after} "):
            raise KeyboardInterrupt

    if not enough:
        with pytest.raises(KeyboardInterrupt):
            measure_passes(request, tmp_path / "out", input, stop)
        return
    passes, _ = measure_passes(request, tmp_path / "out", input, stop)
    saving = device_saving(passes, request, {}, tmp_path / "out")
    assert len(saving.passes) == after
    assert "It was ended after 5 of 8 passes." in saving.notes


def test_a_cable_that_is_plugged_in_keeps_the_passes_before(laptop, clock, tmp_path) -> None:
    def charge(line: str) -> None:
        if line.startswith("pass 2 "):
            (laptop / "status").write_text("Charging\n")

    with pytest.raises(InstrumentError, match=r"'Charging'.*the 2 passes before it are in .*passes\.csv"):
        measure_passes(asked(laptop, 0.0), tmp_path / "out", input, charge)
    assert len(read_rows(DevicePass, tmp_path / "out" / "passes.csv")) == 2


def test_a_straight_drift_is_no_saving(tmp_path) -> None:
    """Both versions take 5 W less 0.1 W a pass; and with 20 % less in the dimmed ones, 20 % at the middle."""
    samples_in(tmp_path, 4.999, 5.0)
    request = PassRequest("adb:", {"full": "a", "dimmed": "b"}, 3, 100.0, 0.0, 1.0, "")

    def saving_of(less: float) -> DeviceSaving:
        passes = [
            DevicePass(k, name, 100.0 * k, 100.0, 5.0 - 0.1 * k - less * (name == "dimmed"), 100, 0, 1.0)
            for k, name in enumerate(request.order())
        ]
        return device_saving(passes, request, {}, tmp_path)

    assert saving_of(0.0).saving_percent == pytest.approx(0.0, abs=1e-9)
    found = saving_of(0.95)  # of 4.75 W at the middle
    assert found.saving_percent == pytest.approx(20.0)
    assert found.drift_percent_h == pytest.approx(-100 * 0.1 * 36 / 4.75)
    assert found.degrees_of_freedom == 3  # six passes, two levels, a slope
    with pytest.raises(InputError, match="2 passes; a saving needs 4"):
        device_saving(found.passes[:2], request, {}, tmp_path)


def test_what_is_detectable_by_hand(tmp_path) -> None:
    """Four passes, so one degree of freedom: t(0.975) = 12.706, t(0.8) = 1.3764 (Student's table)."""
    samples_in(tmp_path, 4.999, 5.0)
    request = PassRequest("adb:", {"full": "a", "dimmed": "b"}, 2, 100.0, 0.0, 1.0, "")
    powers = (10.1, 9.0, 9.0, 10.1)
    passes = [
        DevicePass(k, name, 100.0 * k, 100.0, power + (0.02 if k in (0, 1) else -0.02), 100, 0, 1.0)
        for k, (name, power) in enumerate(zip(request.order(), powers, strict=True))
    ]
    found = device_saving(passes, request, {}, tmp_path)
    half = (found.ci_high - found.ci_low) / 2
    assert found.detectable_percent == pytest.approx(half * (12.706 + 1.3764) / 12.706, rel=1e-3)


def coverage(
    drift: Callable[[np.ndarray, np.random.Generator], np.ndarray], orders: list[list[str]]
) -> float:
    """Of a saving of 10 %, in passes of 120 s and 15 s between them: how often the interval has it in it."""
    rng, held = np.random.default_rng(7), 0
    seconds = np.arange(12 * 135.0)
    for order in orders:
        power = 5.0 * drift(seconds, rng) * (1 + 0.002 * rng.standard_normal(seconds.size))
        means = power.reshape(12, 135)[:, 15:].mean(axis=1)
        passes = [
            DevicePass(k, name, 135.0 * k + 15, 120.0, mean * (0.9 if name == "dimmed" else 1.0), 120, 0, 1.0)
            for k, (name, mean) in enumerate(zip(order, means, strict=True))
        ]
        saving = PassComparison(passes, ("full", "dimmed")).saving("dimmed")
        assert saving is not None
        low, high = saving.interval()
        assert low is not None
        assert high is not None
        held += low <= 0.1 <= high
    return held / len(orders)


@pytest.mark.parametrize("period", [300.0, 405.0, 540.0, 810.0])
def test_no_cycle_of_a_device_keeps_step_with_the_order_of_passes(period: float) -> None:
    """5 % up and down. Full, dimmed, dimmed, full, …, keeps step with 540 s, which is four passes."""

    def cycle(seconds: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return 1 + 0.05 * np.sin(2 * np.pi * seconds / period + rng.uniform(0, 2 * np.pi))

    drawn = [PassRequest("", {}, 6, 120.0, 15.0, 1.0, "", seed=k).order() for k in range(600)]
    assert coverage(cycle, drawn) > 0.9  # 0.95 within chance, of orders and phases
    if period == 540.0:
        assert coverage(cycle, [["full", "dimmed", "dimmed", "full"] * 3] * 600) < 0.5


def test_the_order_of_passes_is_drawn_anew_and_goes_with_no_drift() -> None:
    """The correlation with a straight drift, and with a bent one, is 0.3 at most; nothing else is sure."""
    requests = [PassRequest("", {}, 6, 120.0, 15.0, 1.0, "") for _ in range(100)]
    orders = [request.order() for request in requests]
    assert orders == [request.order() for request in requests]
    assert len({tuple(order) for order in orders}) > 50
    times = np.arange(12) - 5.5
    for order in orders:
        assert order.count("full") == 6
        full = [version == "full" for version in order]
        assert max(abs(np.corrcoef(full, times**power)[0, 1]) for power in (1, 2)) < 0.46  # after 20 draws

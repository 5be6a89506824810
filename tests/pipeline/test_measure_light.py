"""`evenlight measure light`: a recording made by a simulated photodiode, or elsewhere, and its refusals."""

from __future__ import annotations

import json
import os
import stat
import wave
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from evenlight import command
from evenlight.analysis.measurement.light import light_results
from evenlight.analysis.measurement.light.light_findings import analyse_light
from evenlight.analysis.measurement.light.light_recording import load_light_recording
from evenlight.data_schema.provenance import Provenance
from evenlight.experiments import measured_light

RIG = ("--rig", "simulated", "--simulate", "--edges", "16", "--interval-s", "0.2", "--rate-hz", "4000")


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        command.main(["measure", "light", *map(str, arguments)])
    return int(ended.value.code or 0)


def test_a_rehearsal_finds_what_is_true_of_the_simulated_panel(tmp_path: Path, monkeypatch, capsys) -> None:
    """PWM of 240 Hz and 50 %, 6 and 4 ms, 12 ms until the light begins to change: `LightPhysics`."""
    out = tmp_path / "light"
    assert run("--instrument", "simulated", *RIG, "--out", out) == 0
    said = capsys.readouterr().out
    assert "sync patch verified: 16 of 16 edges, none extra" in said
    assert all(line.startswith("SIMULATED") for line in said.splitlines()[:-1])
    results = json.loads((out / "light_results.json").read_text())
    assert results["ripple"]["frequency_hz"] == pytest.approx(240.0, rel=0.001)
    assert results["ripple"]["frequency_ci_low_hz"] < 240.0 < results["ripple"]["frequency_ci_high_hz"]
    assert results["ripple"]["frequency_ci_high_hz"] - results["ripple"]["frequency_ci_low_hz"] < 0.1
    assert results["ripple"]["depth"] == pytest.approx(0.5, abs=0.005)
    assert [one["time_s"] for one in results["response_times"]] == pytest.approx([0.006, 0.004], rel=0.05)
    latency, half = results["latency"], np.log(2) / np.log(9)
    bound = results["clock"]["bound_s"] + 2e-4
    assert latency["median_rising_s"] == pytest.approx(0.012 + half * 0.006, abs=bound)
    assert latency["median_falling_s"] == pytest.approx(0.012 + half * 0.004, abs=bound)
    assert latency["ci_low_s"] < 0.012 + half * 0.005 < latency["ci_high_s"]
    assert {path.name for path in out.glob("*.png")} == {"pwm.png", "response.png", "latency.png"}
    assert run("--instrument", "simulated", *RIG, "--out", out) == 2  # never overwritten
    monkeypatch.setattr(light_results, "_pictures", lambda findings: {})  # they are there once
    with pytest.raises(SystemExit) as ended:
        command.main(["fit", str(out), "--out", str(tmp_path / "again"), "--quiet"])
    assert not ended.value.code
    again = json.loads((tmp_path / "again/light_results.json").read_text())
    assert {**again, "provenance": None} == {**results, "provenance": None}
    # Without pings the arrivals tell the clock; no sample arrives before it was taken.
    clock = (out / "clock.csv").read_text().splitlines()
    (out / "clock.csv").write_text(clock[0] + "\n")
    late = analyse_light(load_light_recording(out), Provenance()).results.latency
    assert late.is_most
    assert 0.012 + half * 0.005 - 1.25e-4 < late.median < 0.012 + half * 0.005 + 0.001  # half a sample


def test_a_bench_measures_darkness_first(monkeypatch, capsys) -> None:
    asked: list[str] = []
    monkeypatch.setattr("builtins.input", lambda question: asked.append(question) or "")
    assert run("--instrument", "simulated", "--dark", "--seconds", "1") == 0
    assert [question.partition(",")[0] for question in asked] == ["cover the photodiode", "uncover it"]
    said = capsys.readouterr().out
    assert "Hz" in said
    assert "at least" not in said


def test_a_simulated_white_is_steady_and_its_pwm_within_the_clocks_tolerance(tmp_path: Path, capsys) -> None:
    """240 Hz on a sampler whose clock is 50 ppm fast reads 239.988 Hz."""
    assert run("--instrument", "simulated", "--seconds", "1", "--out", tmp_path / "light") == 0
    assert "to be steady" not in capsys.readouterr().out
    values = np.loadtxt(tmp_path / "light/light.csv", delimiter=",", skiprows=1)[:, 1]
    assert values.min() > 0.2  # 200 of 400 cd/m^2 at a depth of 0.5
    ripple = json.loads((tmp_path / "light/light_results.json").read_text())["ripple"]
    assert ripple["frequency_ci_low_hz"] < 240.0 < ripple["frequency_ci_high_hz"]


def test_light_that_is_none_or_moves_is_told(tmp_path: Path, capsys) -> None:
    assert run("--instrument", f"file:{recorded(tmp_path / 'none.csv', np.zeros(5000))}") == 2
    assert "so no light reached it" in capsys.readouterr().err
    assert run("--instrument", f"file:{recorded(tmp_path / 'same.csv', np.full(48_000, 0.5))}") == 0
    said = capsys.readouterr().out
    assert "All samples are the same" in said
    assert "none above" not in said
    assert "--dark" not in said
    assert said.startswith("no PWM found from 20 to 24000 Hz\n")
    noise = 0.002 * np.random.default_rng(1).standard_normal(48_000)
    moving = noise + np.repeat([0.5, 0.3], 24_000)
    assert run("--instrument", f"file:{recorded(tmp_path / 'moving.csv', moving)}") == 0
    assert "moved by 50 %" in capsys.readouterr().out  # 0.2 of 0.4


def recorded(path: Path, values: np.ndarray, rate: int = 48_000) -> Path:
    if path.suffix == ".wav":
        with wave.open(str(path), "wb") as sound:
            sound.setnchannels(1)
            sound.setsampwidth(2)
            sound.setframerate(rate)
            sound.writeframes(np.round(values * 32767).astype("<i2").tobytes())
    else:
        rows = (f"{place / rate:.7f},{value:.6f}\n" for place, value in enumerate(values.tolist()))
        path.write_text("time_s,value\n" + "".join(rows))
    return path


def test_recordings_made_elsewhere_are_read(tmp_path: Path, capsys) -> None:
    light = 0.3 * np.sign(np.sin(2 * np.pi * 180.0 * np.arange(48_000) / 48_000 + 0.4))
    noise = 0.002 * np.random.default_rng(1).standard_normal(48_000)
    assert run("--instrument", f"file:{recorded(tmp_path / 'sound.wav', light + noise)}") == 0
    said = capsys.readouterr().out
    assert said.startswith("PWM: 180")
    assert "depth unknown" in said
    assert run("--instrument", f"file:{recorded(tmp_path / 'scope.csv', light + noise + 0.6)}") == 0
    assert "depth at least 50." in capsys.readouterr().out  # 0.3 of 0.6, and no darkness
    assert run("--instrument", f"file:{recorded(tmp_path / 'loud.wav', np.clip(5 * light, -1, 1))}") == 2
    assert "turn its gain down" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("time_s,value\n0,1\n", "holds 1 samples"),
        ("time_s,value\n" + "0,1\n" * 200, "line 3: expected finite numbers, and times that rise"),
        ("time_s,value\n0,nan\n", "line 2: expected a number"),
        ("seconds,volt\n0,1\n", "'seconds'"),
        ("", "is empty"),
    ],
)
def test_a_table_that_is_no_recording_is_refused(tmp_path: Path, capsys, content: str, words: str) -> None:
    (tmp_path / "light.csv").write_text(content)
    assert run("--instrument", f"file:{tmp_path / 'light.csv'}", "--out", tmp_path / "out") == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("--instrument", "simulated", "--seconds", "inf"),
            "--seconds must be a finite number, got inf",
        ),
        (
            ("--instrument", "simulated", "--seconds", "700"),
            "--seconds must lie between 0.5 and 600, got 700",
        ),
        (("--instrument", "simulated", "--seconds", "600", "--rate-hz", "48000"), "at most 5,000,000"),
        (("--instrument", "file:none.csv", "--dark"), "a recording made elsewhere"),
        (("--instrument", "simulated", "--simulate"), "give it with --rig"),
        (("--instrument", "simulated", "--dark", *RIG), "the black corner tells"),
        (("--instrument", "light:COM3"), "there is no sampler of light 'light'"),
        (("--instrument", "adc"), "where is it?"),
        (("--instrument", "file:none.wav"), "there is no such file"),
        (("--instrument", "file:none.csv", *RIG), "a recording made elsewhere"),
    ],
)
def test_bad_input_is_told_in_one_line(capsys, arguments: tuple[str, ...], words: str) -> None:
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_port_that_is_not_there_is_told_in_one_line(tmp_path: Path, capsys) -> None:
    assert run("--instrument", f"adc:{tmp_path / 'none'}") == 1
    assert "cannot be opened" in capsys.readouterr().err


ARECORD = """#!/usr/bin/env python3
import math, struct, sys, time
asked = sys.argv[1:]
assert asked[asked.index("-f") + 1] == "S16_LE" and asked[asked.index("-t") + 1] == "raw", asked
rate, count = int(asked[asked.index("-r") + 1]), 0
while True:
    tone = [9000 * math.sin(2 * math.pi * 310 * n / rate) for n in range(count, count + 960)]
    block = [round(value) + n * 7919 % 41 for n, value in enumerate(tone)]
    sys.stdout.buffer.write(struct.pack("<960h", *block))
    sys.stdout.buffer.flush()
    count += 960
    time.sleep(0.003)
"""


def test_a_sound_card_tells_the_frequency_and_says_what_it_cannot(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("evenlight.hardware.drivers.sound_card.SILENCE", 30.0)  # of a busy computer
    program = tmp_path / "arecord"
    program.write_text(ARECORD)
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert run("--instrument", "soundcard:hw:1", "--seconds", "0.5") == 0
    said = capsys.readouterr().out
    assert said.startswith("PWM: 310")
    assert "depth unknown" in said
    assert "AC-coupled" in said
    program.write_text("#!/bin/sh\necho 'arecord: audio open error: No such file or directory' >&2; exit 1\n")
    assert run("--instrument", "soundcard:absent") == 1
    assert "No such file or directory" in capsys.readouterr().err
    monkeypatch.setenv("PATH", str(tmp_path / "none"))
    assert run("--instrument", "soundcard:") == 1
    assert "apt install alsa-utils" in capsys.readouterr().err


class FakeWindow:
    """A window of 60 Hz that remembers what each flip showed in the corner and beside it."""

    def __init__(self) -> None:
        self._time, self._drawn = 10.0, {}
        self.shown: list[tuple[float, dict[str, float]]] = []
        self.closed = False

    def now(self) -> float:
        return self._time

    def size(self) -> tuple[int, int]:
        return 640, 480

    def framebuffer(self) -> FakeWindow:
        return self

    def clear(self, red: float, *_: float, viewport: tuple[int, ...] | None = None) -> None:
        if viewport is not None:
            assert viewport == (0, 416, 64, 64)  # the upper left corner, from the foot
        self._drawn["screen" if viewport is None else "corner"] = red

    def flip(self) -> float:
        self._time += 1 / 60
        self.shown.append((self._time, dict(self._drawn)))
        return self._time

    def apparatus(self) -> dict[str, str]:
        return {"window": "fake"}

    def close(self) -> None:
        self.closed = True


class FakeKeyboard:
    def __init__(self, presses: list[str]) -> None:
        self._presses = presses

    def pressed(self) -> list[SimpleNamespace]:
        return [SimpleNamespace(name=name) for name in self._presses]

    def close(self) -> None:
        pass


def test_flips_are_those_of_the_window_at_which_the_corner_changed(tmp_path: Path, monkeypatch) -> None:
    window = FakeWindow()
    monkeypatch.setattr(measured_light, "open_window", lambda rig: window)
    monkeypatch.setattr(measured_light, "open_keyboard", lambda _: FakeKeyboard([]))
    monkeypatch.setattr(light_results, "_pictures", lambda findings: {})  # they take the time
    out = tmp_path / "light"
    assert run("--instrument", "simulated", *RIG[:2], *RIG[3:], "--out", out) == 0
    corner = [drawn["corner"] for _, drawn in window.shown]
    assert {drawn["screen"] for _, drawn in window.shown} == {0.5}
    changed = [
        (window.shown[k][0], corner[k]) for k in range(len(corner)) if k == 0 or corner[k] != corner[k - 1]
    ]
    rows = [row.split(",") for row in (out / "light_flips.csv").read_text().splitlines()[1:]]
    assert [(float(flip), float(lit == "True")) for flip, lit in rows] == [
        (pytest.approx(flip), lit) for flip, lit in changed
    ]
    assert len(rows) == 17  # the white that all begins with, and 16 changes
    assert json.loads((out / "light_results.json").read_text())["n_edges"] == 16
    assert window.closed


def test_escape_ends_it_and_keeps_nothing(tmp_path: Path, monkeypatch) -> None:
    window = FakeWindow()
    monkeypatch.setattr(measured_light, "open_window", lambda rig: window)
    monkeypatch.setattr(measured_light, "open_keyboard", lambda _: FakeKeyboard(["escape"]))
    assert run("--instrument", "simulated", *RIG[:2], "--out", tmp_path / "light") == 130
    assert len(window.shown) == 1
    assert window.closed
    assert not (tmp_path / "light").exists()

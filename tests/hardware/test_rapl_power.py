"""RAPL's energy counters: power as energy over time, round the end of the counter, and rights, in words."""

from __future__ import annotations

import errno
from pathlib import Path

import numpy as np
import pytest

from evenlight.hardware.drivers.rapl_power import RaplPowerMeter
from evenlight.hardware.protocols import Fault, InstrumentError
from evenlight.hardware.simulated.clocks import WaitingClock

INTEL_END = 262_143_328_850  # [µJ] 32 bits of 61 µJ, as an Intel processor states it


def domain(root: Path, folder: str, name: str, energy: int, end: int = INTEL_END) -> Path:
    path = root / "class/powercap" / folder
    path.mkdir(parents=True, exist_ok=True)
    for file, text in (("name", name), ("energy_uj", energy), ("max_energy_range_uj", end)):
        (path / file).write_text(f"{text}\n")
    return path


@pytest.fixture
def package(tmp_path) -> Path:
    return domain(tmp_path, "intel-rapl:0", "package-0", 1_000_000)


def counted(package: Path, meter: RaplPowerMeter, clock: WaitingClock, seconds: float, energy: int) -> float:
    """Return the power of a sample after some time, with the counter somewhere."""
    clock.wait(seconds)
    (package / "energy_uj").write_text(f"{energy}\n")
    (sample,) = meter.samples()
    assert sample.device_time == clock.now()
    return sample.power


def test_power_is_the_energy_since_the_last_look_over_the_time(tmp_path, package) -> None:
    clock = WaitingClock()
    with RaplPowerMeter("", clock.now, root=tmp_path) as meter:
        meter.start(1.0)
        assert meter.samples() == []  # no time has passed
        assert counted(package, meter, clock, 1.0, 13_000_000) == pytest.approx(12.0)
        assert counted(package, meter, clock, 2.0, 43_000_000) == pytest.approx(15.0)  # asked late
        meter.stop()
        clock.wait(100.0)  # of no account: what was counted meanwhile belongs to no sample
        (package / "energy_uj").write_text("900000000\n")
        meter.start(1.0)
        assert counted(package, meter, clock, 1.0, 907_000_000) == pytest.approx(7.0)


def test_the_counter_goes_round_at_its_end(tmp_path) -> None:
    clock, package = WaitingClock(), domain(tmp_path, "intel-rapl:0", "package-0", INTEL_END - 4_000_000)
    with RaplPowerMeter("package-0", clock.now, root=tmp_path) as meter:
        meter.start(1.0)
        assert counted(package, meter, clock, 1.0, 6_000_000) == pytest.approx(10.0)


def test_a_counter_that_may_have_gone_round_twice_tells_nothing(tmp_path) -> None:
    """65 532 J, as on AMD's: at 2000 W it goes round in 33 s."""
    clock, package = WaitingClock(), domain(tmp_path, "intel-rapl:0", "package-0", 0, 65_532_610_987)
    with RaplPowerMeter("", clock.now, root=tmp_path) as meter:
        meter.start(1.0)
        with pytest.raises(
            InstrumentError, match=r"40 s since it was last read.*round more than once"
        ) as told:
            counted(package, meter, clock, 40.0, 5_000_000)
        assert told.value.fault is Fault.NO_REPLY
        assert counted(package, meter, clock, 1.0, 8_000_000) == pytest.approx(3.0)


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("1000000", Fault.NO_REPLY),  # it stands still
        ("500000", Fault.IMPLAUSIBLE),  # back, as after hibernation: taken for a whole round, 262 kW
        ("4000000000", Fault.IMPLAUSIBLE),  # 4 kW
        ("400000000000", Fault.IMPLAUSIBLE),  # beyond its end
        ("-3", Fault.IMPLAUSIBLE),
        ("", Fault.GARBLED),
        ("inf", Fault.GARBLED),
    ],
)
def test_what_no_counter_says_is_an_error_and_not_a_power(tmp_path, package, text, fault) -> None:
    clock = WaitingClock()
    with RaplPowerMeter("", clock.now, root=tmp_path) as meter:
        meter.start(1.0)
        clock.wait(1.0)
        (package / "energy_uj").write_text(text)
        with pytest.raises(InstrumentError) as told:
            meter.samples()
        assert told.value.fault is fault
        assert str(package) in str(told.value)
        (package / "energy_uj").write_text("20000000")
        if text == "400000000000":  # never a counter's; what was read before still counts
            clock.wait(1.0)
            assert meter.samples()[0].power == pytest.approx(9.5)


def test_what_only_root_may_read_says_since_when_and_what_to_do(tmp_path, package, monkeypatch) -> None:
    def denied(path: Path) -> float:
        if path.name != "energy_uj":
            return float(path.read_text())
        raise InstrumentError(f"{path}: may not be read", Fault.NOT_FOUND, errno.errorcode[errno.EACCES])

    monkeypatch.setattr("evenlight.hardware.drivers.rapl_power.read_number", denied)
    with pytest.raises(InstrumentError, match=r"only root may read it since 2020.*sudo chmod a.r") as told:
        RaplPowerMeter("", root=tmp_path)
    assert str(package / "energy_uj") in str(told.value)


def test_domains_go_by_their_names_and_the_same_package_counts_once(tmp_path, package) -> None:
    domain(tmp_path, "intel-rapl-mmio:0", "package-0", 1)
    domain(tmp_path, "intel-rapl:0:0", "core", 1)
    domain(tmp_path, "intel-rapl:1", "psys", 1)
    with RaplPowerMeter("", root=tmp_path) as meter:
        assert str(package) in meter.apparatus()["power_meter_files"]
    with RaplPowerMeter("psys", root=tmp_path) as meter:
        assert "psys: what the processor's counters see, not the panel" in meter.apparatus()["power_meter"]
    domain(tmp_path, "intel-rapl:2:0", "core", 1)
    with pytest.raises(InstrumentError, match=r"several: core \(intel-rapl:0:0\), core \(intel-rapl:2:0\)"):
        RaplPowerMeter("core", root=tmp_path)
    with RaplPowerMeter("intel-rapl:2:0", root=tmp_path):
        pass
    with pytest.raises(InstrumentError, match=r"rapl:dram: no such domain.*there is package-0") as told:
        RaplPowerMeter("dram", root=tmp_path)
    assert told.value.fault is Fault.NOT_FOUND


@pytest.mark.slow
def test_a_counter_read_at_random_times_gives_the_mean_power_of_each_stretch(tmp_path, package) -> None:
    """A load of 5 to 90 W, counted in steps of 61 µJ, over several rounds of a short counter."""
    rng, clock = np.random.default_rng(4), WaitingClock()
    end = 5_000_000_000
    domain(tmp_path, "intel-rapl:0", "package-0", 0, end)
    energy = 0.0
    with RaplPowerMeter("", clock.now, root=tmp_path) as meter:
        meter.start(20.0)
        for _ in range(300):
            seconds, load = rng.uniform(0.06, 2.0), rng.uniform(5.0, 90.0)
            energy += 1e6 * load * seconds
            shown = round(energy / 61.035) * 61.035 % end
            assert counted(package, meter, clock, seconds, int(shown)) == pytest.approx(load, rel=1e-3)
    assert energy > 2 * end

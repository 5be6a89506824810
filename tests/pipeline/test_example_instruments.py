"""The package of drivers in examples/, installed: listed, measured and swept with, and it conforms."""

import csv
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import evenlight

EXAMPLE = Path(evenlight.__file__).parents[1] / "examples" / "evenlight-instruments"
NAMES = ("example-spot", "example-watt", "example-lamp")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example package, installed as pip installs it: from a copy, with nothing from any index."""
    copy, site = tmp_path_factory.mktemp("source") / "instruments", tmp_path_factory.mktemp("site")
    shutil.copytree(EXAMPLE, copy)
    words = ["--no-index", "--no-build-isolation", "--no-deps", "--quiet", "--target", str(site), str(copy)]
    subprocess.run([sys.executable, "-m", "pip", "install", *words], timeout=200, check=True)
    return site


@pytest.fixture(autouse=True)
def _installed(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(site)
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "evenlight_instruments"]:
        del sys.modules[name]


def test_its_drivers_are_listed_with_their_package(command: Any) -> None:
    listed = command("measure", "list")
    assert (listed.code, listed.err) == (0, "")
    for name in NAMES:
        assert f"  {name} example" in listed.out
    assert listed.out.count("of the package evenlight-instruments") == 3


def test_they_measure(command: Any) -> None:
    """A warm white panel: 200 cd/m^2, and 0.2945 + 0.001858 * 200 = 0.6661 W."""
    done = command("measure", "luminance", "--instrument", "simulated:example-spot", "--count", 1, "--quiet")
    assert done.out.startswith("SIMULATED: 200 cd/m^2")
    words = ("--seconds", 0.5, "--rate-hz", 20, "--quiet")
    done = command("measure", "power", "--instrument", "simulated:example-watt", *words)
    assert done.out.startswith("SIMULATED: 0.6661 W")
    gone = command("measure", "luminance", "--instrument", "example-spot:/dev/no_such_port")
    assert (gone.code, gone.err.count("\n")) == (1, 1)
    assert "/dev/no_such_port" in gone.err


def test_the_command_finds_them_where_they_are_installed(site: Path) -> None:
    """In a process of its own, which knows nothing but the path; a broken promise would end it with 1."""
    words = ["measure", "conform", "simulated:example-spot"]
    done = subprocess.run(
        [sys.executable, "-m", "evenlight", *words],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(site), *filter(None, sys.path)])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    *lines, closing = done.stdout.splitlines()
    assert closing == "simulated:example-spot, a luminance meter: 4 promises kept, 0 broken"
    assert all(line.startswith("kept  ") for line in lines)


RIG = """
name = "lab"
display = "varjo-xr3"
viewing_distance_m = 0.6
refresh_rate_hz = 60.0
backlight = "simulated:example-lamp"
luminance_meter = "simulated:example-spot"
"""
DESIGN = """
name = "short"
pixel_values = [0.0, 0.5, 1.0]
factors = [0.5, 1.0]
settle_s = 0.05
warm_up_s = 0.0
"""


def test_a_rig_that_names_them_sweeps_the_display(command: Any, tmp_path: Path) -> None:
    """The lamp dims the panel that the spot meter looks at: in its 200 steps, 0.5 and 1 are exact."""
    rig, design = tmp_path / "lab.rig.toml", tmp_path / "short.design.toml"
    rig.write_text(RIG)
    design.write_text(DESIGN)
    words = ("--session", "01", "--rig", rig, "--design", design, "--simulate", "data", "--quiet")
    done = command("run", "luminance-sweep", *words, "--out", tmp_path / "lab")
    assert done.code == 0
    table = (tmp_path / "lab/sweeps/luminance-sweep_01/brightness.csv").read_text()
    rows = list(csv.DictReader(table.splitlines()))
    assert [float(row["factor"]) for row in rows] == [0.5, 1.0]
    dim, full = (float(row["luminance_cd_m2"]) for row in rows)
    assert dim == pytest.approx(full / 2, rel=0.02)

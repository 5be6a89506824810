"""One import package: what a wheel holds, and that nobody else's folders or packages stand in its way."""

import importlib
import os
import re
import site
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import evenlight

ROOT = Path(evenlight.__file__).parents[1]
FOLDERS = ("data_schema", "method", "hardware", "stimuli", "experiments", "analysis")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of a copy of the checkout: the files that git tracks, links and all."""
    copy, out = tmp_path_factory.mktemp("checkout"), tmp_path_factory.mktemp("wheel")
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in tracked.splitlines():
        source, target = ROOT / name, copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_symlink():
            target.symlink_to(source.readlink())
        elif source.exists():
            target.write_bytes(source.read_bytes())
    build = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        str(out),
    ]
    done = subprocess.run([*build, str(copy)], capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("*.whl"))


@pytest.mark.slow
def test_the_wheel_holds_one_package_and_nothing_else(wheel: Path) -> None:
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names} == {
        "evenlight",
        wheel.name.rsplit("-", 3)[0] + ".dist-info",
    }


@pytest.mark.slow
def test_the_wheel_holds_every_module_and_every_file_that_they_read(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    wanted = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file()]
    own = {f"evenlight/{p.relative_to(ROOT).as_posix()}" for p in wanted if "__pycache__" not in p.parts}
    own |= {f"evenlight/{p.name}" for p in (ROOT / "evenlight").iterdir() if p.is_file()}
    assert own - held == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    "program", [("-m", "evenlight", "--help"), ("-c", "import evenlight.method.contrast.csf")]
)
def test_a_folder_with_packages_of_our_folders_names_is_not_in_the_way(
    tmp_path: Path, program: tuple[str, ...]
) -> None:
    for folder in (*FOLDERS, "benchmarks"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "__init__.py").write_text(f"raise RuntimeError('the decoy {folder}')\n")
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, *program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_module_is_importable_under_a_second_name(folder: str) -> None:
    """In the checkout itself, where the folders lie side by side."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {folder}"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert f"ImportError: import it as evenlight.{folder}" in done.stderr


def test_every_folder_with_modules_is_a_package_that_is_installed() -> None:
    """A sub-package that pyproject does not list would be missing in a wheel."""
    import tomllib

    configured = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = {p.parent.relative_to(ROOT) for folder in FOLDERS for p in (ROOT / folder).rglob("*.py")}
    assert set(configured) == {"evenlight", *(".".join(("evenlight", *p.parts)) for p in found)}


def test_importing_the_package_loads_nothing_slow() -> None:
    program = "import sys, evenlight; print(*sorted(m for m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    slow = {"numpy", "numba", "matplotlib", "pandas", "psychopy", "scipy", "typer"}
    assert slow.isdisjoint(name.partition(".")[0] for name in done.stdout.split())


def test_every_public_name_is_there_and_listed() -> None:
    assert set(evenlight.__all__) <= set(dir(evenlight))
    for name in evenlight.__all__:
        assert getattr(evenlight, name).__module__.startswith("evenlight")
    with pytest.raises(AttributeError, match="no attribute 'optimise'"):
        importlib.import_module("evenlight").optimise  # noqa: B018 - the attribute is asked for


def test_the_package_knows_its_version(command: Any) -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert evenlight.__version__ == declared
    assert command("--version").out == f"evenlight {declared}\n"


def test_a_checkout_that_is_not_installed_knows_its_version_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def not_installed(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    installed = evenlight.__version__
    monkeypatch.setattr(metadata, "version", not_installed)
    assert evenlight.__version__ == installed


def test_what_set_up_installs_is_pinned_to_the_version_that_is_here() -> None:
    """All that set-up asks for, what that needs in turn, and the package that builds.

    Whoever installs `judge`, or a tool of their own, beside it may: they are not pinned.
    """
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    requirements = [Requirement(line) for line in lines]
    assert all([s.operator for s in r.specifier] == ["=="] for r in requirements)
    pins = {canonical(r.name): r for r in requirements if r.marker is None or r.marker.evaluate()}
    here = {
        canonical(found.name): found.version for found in metadata.distributions(path=site.getsitepackages())
    }
    installed = reached("evenlight", ("dev", "lab"), set()) & here.keys()
    assert {"numpy", "pytest", "mypy"} <= installed
    assert installed - pins.keys() == set()
    assert {name for name in installed if not pins[name].specifier.contains(here[name])} == set()
    [build] = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert Requirement(build).specifier.contains(next(iter(pins["setuptools"].specifier)).version)


def reached(package: str, extras: tuple[str, ...], seen: set[tuple[str, str]]) -> set[str]:
    """The names of all packages that a package needs with some extras, near and far."""
    names: set[str] = set()
    for extra in ("", *extras):
        if (package, extra) in seen:
            continue
        seen.add((package, extra))
        try:
            lines = metadata.requires(package) or []
        except metadata.PackageNotFoundError:
            return names
        for needed in map(Requirement, lines):
            if needed.marker is None or needed.marker.evaluate({"extra": extra}):
                name = canonical(needed.name)
                names |= {name, *reached(name, tuple(needed.extras), seen)} - {"evenlight"}
    return names


def canonical(name: str) -> str:
    """A package's name as indexes compare it (PyPA: names are equal but for case and runs of `-_.`)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_pythons_that_psychopy_has_no_packages_for_are_only_without_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert all(f"3.{minor}.0" in SpecifierSet(project["requires-python"]) for minor in (11, 12, 13, 14))
    [lab] = [Requirement(line) for line in project["optional-dependencies"]["lab"]]
    wanted = {
        version: lab.marker.evaluate({"python_version": version})
        for version in ("3.11", "3.12", "3.13", "3.14")
    }
    assert wanted == {"3.11": True, "3.12": True, "3.13": False, "3.14": False}

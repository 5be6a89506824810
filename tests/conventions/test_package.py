"""One import package, and the rules that the house keeps."""

import importlib
import os
import re
import site
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import line_budget
import pytest
import typer
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import evenlight
from evenlight import command as command_line
from evenlight.data_schema.rate_limit import RateLimitForm
from evenlight.method.choices import LimitCurve

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


def test_no_module_is_importable_under_a_second_name() -> None:
    """In the checkout itself, where the folders lie side by side."""
    program = """
import importlib, sys
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError as error:
        print(error)
"""
    words = [sys.executable, "-c", program, *FOLDERS]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    told = done.stdout.splitlines()
    assert len(told) == len(FOLDERS)
    for line, folder in zip(told, FOLDERS, strict=True):
        assert f"import it as evenlight.{folder}" in line


def test_every_folder_with_modules_is_a_package_that_is_installed() -> None:
    """A sub-package that pyproject does not list would be missing in a wheel."""
    import tomllib

    configured = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    found = {p.parent.relative_to(ROOT) for folder in FOLDERS for p in (ROOT / folder).rglob("*.py")}
    assert set(configured) == {"evenlight", *(".".join(("evenlight", *p.parts)) for p in found)}


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


def test_all_that_set_up_fetches_has_hashes_and_the_version_of_its_pin() -> None:
    pins: dict[str, set[str]] = {}
    for line in (ROOT / "constraints.txt").read_text().splitlines():
        pinned = Requirement(line)
        pins.setdefault(canonical(pinned.name), set()).add(str(pinned.specifier))
    fetched = set()
    for path in (ROOT / "requirements").glob("*.txt"):
        for entry in path.read_text().replace("\\\n", " ").splitlines():
            needed, *hashes = entry.split(" --hash=")
            requirement = Requirement(needed.strip())
            name = canonical(requirement.name)
            fetched.add(name)
            # The frameworks of macOS, which PsychoPy needs there, have no pin of their own.
            assert str(requirement.specifier) in pins.get(name, set()) or name.startswith("pyobjc"), needed
            assert hashes
            assert all(re.fullmatch(r"sha256:[0-9a-f]{64}", one.strip()) for one in hashes)
    assert fetched >= pins.keys()


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


# --- house


def command_names() -> set[str]:
    group = typer.main.get_command(command_line.app)
    return set(group.commands)


def test_the_documents_list_exactly_the_commands_there_are() -> None:
    table = (ROOT / "docs" / "commands.md").read_text()
    listed = set(re.findall(r"^\| `evenlight ([a-z-]+)", table, flags=re.MULTILINE))
    assert listed == command_names()


@pytest.mark.slow
def test_every_command_helps_within_its_own_words(command) -> None:
    for name in sorted(command_names()):
        result = command(name, "--help")
        assert result.code == 0


@pytest.mark.parametrize(
    "pattern", ["*.md", "docs/**/*.md", "*.toml", "[a-z]*/*.py", "[a-z]*/schemas/*.json"]
)
def test_nothing_promises_that_a_change_cannot_be_noticed(pattern: str) -> None:
    """The rate limit is what the median participant, watching for it, notices in 75 % of the trials."""
    promise = re.compile(
        r"undetectabl|imperceptibl|unnotic|nobody sees the brightness|goes unseen|change unseen"
    )
    files = [path for path in ROOT.glob(pattern) if path.name != Path(__file__).name]
    assert files
    for path in files:
        assert not promise.search(path.read_text()), path


def test_the_folders_of_the_house_plan_are_the_packages() -> None:
    configured = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-dir"]
    assert set(configured.values()) == set(FOLDERS)
    house = (ROOT / "docs" / "house.md").read_text()
    for package in FOLDERS:
        assert f"`{package}/`" in house
        assert (ROOT / package / "__init__.py").exists()


def test_no_module_has_a_name_that_says_nothing() -> None:
    empty = {"utils", "util", "helpers", "helper", "common", "core", "base", "misc"}
    names = [path.stem for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    assert len(names) > 50
    assert not empty & set(names)
    assert not {name for name in names if name in sys.stdlib_module_names}


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs" / "decisions").glob("*.md")), ids=lambda page: page.stem
)
def test_a_decision_fits_on_a_screen(page: Path) -> None:
    assert len(page.read_text().split()) <= 500


def test_the_end_of_a_run_says_what_failed_and_why_something_was_skipped(pytestconfig: pytest.Config) -> None:
    """Of pytest's -r: f failed, E ended in an error, s skipped."""
    assert set("fEs") <= set(pytestconfig.option.reportchars)


def test_lines_of_product_content_and_tests_are_counted_and_kept_within_limits(tmp_path: Path) -> None:
    files = {
        "method/a.py": 3, "stimuli/scenes/content/b.py": 4, "stimuli/scenes/c.py": 5, "tests/x/test_d.py": 6,
        "benchmarks/e.py": 7, "docs/f.py": 8, "method/shader.glsl": 9,
    }  # fmt: skip
    for name, lines in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("\n" * lines)
    found = line_budget.lines_of(tmp_path, [*files, "method/gone.py"])
    assert found == {"product": 8, "content": 4, "tests": 6, "benchmarks": 7}
    assert line_budget.report(found, {"product": 8, "content": 4, "tests": 6})[1]
    text, kept = line_budget.report(found, {"product": 8, "content": 3, "tests": 6})
    assert not kept
    assert "content: 4 lines of 3" in text
    assert "Too many lines: content." in text
    limits = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["evenlight"]["lines"]
    assert set(limits) == set(found)
    assert "line_budget.py" in (ROOT / "Makefile").read_text().split("\ncheck:")[1].split("\n\n")[0]


# --- sessions guide

GUIDE = " ".join((Path(evenlight.__file__).parents[1] / "docs/sessions.md").read_text().split())

LONGEST = 220  # lines


@pytest.mark.parametrize(
    "said",
    [
        "Sessions are shown on a monitor",
        'or [in a headset](headset.md) (`screen = "openxr"`)',
        "Every luminance of a session comes from this file",
        f"`--form {RateLimitForm.LOG_LOG.value} --degree 1`",
        f"`--limit-curve {LimitCurve.SAFE.value}`",
        "The joint model's band is simultaneous",
        "With `--model individual` or `pooled` it is pointwise",
        "A rig names keys by what is printed on them",
        "--font NotoSansJP-Regular.ttf",
    ],
)
def test_the_guide_says(said: str) -> None:
    assert said in GUIDE


def test_the_guide_is_no_book() -> None:
    text = (Path(evenlight.__file__).parents[1] / "docs/sessions.md").read_text()
    assert text.count("\n") <= LONGEST


# --- tried again


@pytest.fixture
def is_worth_another_try(request: pytest.FixtureRequest) -> Callable[[pytest.TestReport], bool]:
    plugins = request.config.pluginmanager.get_plugins()
    return next(one.is_worth_another_try for one in plugins if hasattr(one, "is_worth_another_try"))


@pytest.mark.parametrize(
    ("when", "why", "again"),
    [
        ("call", "E  assert 0.31 < 0.25", True),
        ("setup", "E  assert -11 == 0", False),
        ("teardown", "E  a thread is left", False),
        ("call", "E  Failed: Timeout (>300.0s) from pytest-timeout.", False),
    ],
)
def test_what_could_not_be_set_up_or_hung_is_not_tried_again(
    is_worth_another_try: Callable[[pytest.TestReport], bool], when, why: str, again: bool
) -> None:
    report = pytest.TestReport("test", ("test.py", 1, "test"), {}, "failed", why, when)
    assert is_worth_another_try(report) is again

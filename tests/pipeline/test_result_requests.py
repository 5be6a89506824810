"""`request.toml`: what was asked, defaults too, and of what; with `--request` it makes the result again."""

import inspect
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from evenlight.command import COMMANDS
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.storage.result_folders import result_folder
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.result_requests import recorded, write_request

pytestmark = pytest.mark.usefixtures("blank_pictures")
FAST = ("--no-player", "--no-cache", "--quiet")


@pytest.fixture
def film(tmp_path: Path, make_video: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    """A film of 20 frames in the current folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("evenlight.analysis.tracks.track_results._draw", lambda *_: None)
    make_video(tmp_path / "film.mkv", 0.5 + 0.4 * np.cos(np.arange(20) / 5), (48, 32), 5.0)
    return "film.mkv"


def asked_in(folder: str) -> dict[str, Any]:
    asked: dict[str, Any] = tomllib.loads(Path(folder, "request.toml").read_text())
    return asked


def test_a_result_is_made_again_and_an_option_beside_it_overrides(command: Any, film: str) -> None:
    made = command("optimize", film, "--budget", 0.5, "--calm", 0.2, "--out", "track", *FAST)
    assert made.code == 0, made.err
    request = asked_in("track")
    assert request["command"] == "optimize"
    assert request["provenance"]["inputs"] == {film: sha256_of_file(Path(film))}
    asked = request["asked"]
    assert (asked["video"], asked["budget"], asked["calm"], asked["no_player"]) == (film, 0.5, 0.2, True)
    assert (asked["min_factor"], asked["solver"], asked["seed"]) == (0.2, "splitting", 1)  # defaults
    assert "quiet" not in asked  # of no influence
    assert "fps" not in asked  # not given

    again = command("optimize", "--request", "track/request.toml", "--out", "again", "--quiet")
    assert (again.code, again.err) == (0, "")
    assert Path("again/track.csv").read_bytes() == Path("track/track.csv").read_bytes()
    assert asked_in("again")["asked"] == asked | {"out": "again"}

    darker = command("optimize", "--request", "track", "--budget", 0.4, "--out", "darker", "--quiet")
    assert darker.code == 0, darker.err
    track = read_track(Path("darker/track.csv"))
    assert np.average(track.factors) == pytest.approx(0.4, abs=1e-6)
    assert asked_in("darker")["asked"] == asked | {"out": "darker", "budget": 0.4}

    checked = command("validate", "again")
    assert checked.code == 0
    assert "request.toml (result request)" in checked.out


def test_a_film_is_hashed_by_who_reads_it(command: Any, film: str, monkeypatch: pytest.MonkeyPatch) -> None:
    hashed: list[str] = []

    def counted(path: Path) -> str:
        hashed.append(path.name)
        return sha256_of_file(path)

    monkeypatch.setattr("evenlight.data_schema.provenance.sha256_of_file", counted)
    made = command("optimize", f"./{film}", "--budget", 0.5, "--out", "track", *FAST)
    assert made.code == 0, made.err
    assert asked_in("track")["provenance"]["inputs"] == {f"./{film}": sha256_of_file(Path(film))}
    assert hashed == []


def test_what_holds_for_an_option_that_was_not_given_is_told(command: Any, film: str) -> None:
    assert command("control", film, "--target-loss", 0.05, "--out", "track", *FAST).code == 0
    notes = [line for line in Path("track/request.toml").read_text().splitlines() if line.startswith("#")]
    assert "# proportional: not given; 0.2" in notes
    assert "# horizon: not given; 60" in notes
    assert not any(line.startswith(("# target_loss", "# quiet", "# request")) for line in notes)


def test_one_request_at_a_time(command: Any) -> None:
    refused = command("optimize", "--request", "a", "--request=b", "--out", "track")
    assert (refused.code, refused.err) == (
        2,
        "evenlight: --request is given twice; give one, and beside it what is to differ\n",
    )


def test_names_and_values_of_a_request_are_validated(command: Any, tmp_path: Path) -> None:
    file = tmp_path / "request.toml"
    file.write_text(
        'command = "optimize"\n[asked]\nvideo = "a.mp4"\nbugdet = 0.5\nseed = 1.5\ndevice = "fast"\n'
        "battery_wh = -5\nrobust = true\n"
    )
    checked = command("validate", file)
    assert checked.code == 1
    assert checked.out.splitlines()[:4] == [
        f"problem      {file}, line 4: asked: unknown key 'bugdet'; did you mean 'budget'?",
        f"problem      {file}, line 5: asked: seed: expected a whole number, got 1.5",
        f"problem      {file}, line 6: asked: device: expected one of 'cpu', 'gpu', 'auto', got 'fast'",
        f"problem      {file}, line 7: asked: battery_wh must lie in 0.001 to 1e+06, got -5",
    ]


def test_lists_and_secrets(command: Any, film: str) -> None:
    made = command("optimize", film, "--with", film, "--with", film, "--budget", 0.5, "--out", "track", *FAST)
    assert made.code == 0, made.err
    assert asked_in("track")["asked"]["others"] == [film, film]
    again = command("optimize", "--request", "track", "--out", "again", "--quiet")
    assert again.code == 0, again.err
    assert len(list(Path("again").glob("*/track.csv"))) == 3
    url = "https://me:word@host/film.mp4?key=12"
    write_request(Path("there"), "optimize", {"video": url}, {url: 64 * "a"})
    assert asked_in("there")["asked"] == {"video": "https://host/film.mp4"}
    assert asked_in("there")["provenance"]["inputs"] == {"https://host/film.mp4": 64 * "a"}


def test_a_file_that_has_changed_is_told_of(command: Any, film: str, make_video: Any) -> None:
    assert command("control", film, "--target-loss", 0.05, "--out", "track", *FAST).code == 0
    make_video(Path(film), 0.5 + 0.4 * np.sin(np.arange(20) / 5), (48, 32), 5.0)
    again = command("control", "--request", "track", "--quiet")
    assert (again.code, again.err) == (
        0,
        "evenlight: note: film.mkv is not as it was when track/request.toml was written\n",
    )


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('command = "optimise"', "command must be one of optimize, control, "),
        ('command = "control"', "request.toml: is of `evenlight control`; give it to that command"),
        (
            'command = "optimize"\n[asked]\nbugdet = 0.5',
            "request.toml: asked: unknown key 'bugdet'; did you mean 'budget'?",
        ),
        ('command = "optimize"\n[asked]\nbudget = 0.5', "Missing argument 'video'"),
        (
            'command = "optimize"\n[asked]\nvideo = "a.mp4"\nbudget = 0.5',
            "(asked in request.toml; names in it are",
        ),
    ],
)
def test_what_cannot_be_asked_is_said_in_one_line(command: Any, film: str, text: str, told: str) -> None:
    Path("request.toml").write_text(text)
    refused = command("optimize", "--request", "request.toml", "--out", "track")
    assert refused.code == 2
    assert told in refused.err
    assert refused.err.count("\n") == 1
    assert not Path("track").exists()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('budget = "half"', "budget: expected a number, got 'half'"),
        ("calm = true", "calm: expected a number, got true"),
        ("calm = 2", "calm must lie in 0 to 1, got 2"),
        ("calm = nan", "calm must be a finite number, got nan"),
        ("seed = 1.5", "seed: expected a whole number, got 1.5"),
        ('robust = "yes"', "robust: expected true or false, got 'yes'"),
        ('device = "fast"', "device: expected one of 'cpu', 'gpu', 'auto', got 'fast'"),
        ("display = 5", "display: expected text, got 5"),
        ('others = "b.mp4"', "others: expected a list, got 'b.mp4'"),
        ("others = [1]", "others: expected text, got 1"),
        ("battery_wh = -5", "battery_wh must lie in 0.001 to 1e+06, got -5"),
        ('lowest_factor = "a"', "unknown key 'lowest_factor'; it is called 'min_factor'"),
        ('with = ["b.mp4"]', "unknown key 'with'; it is called 'others'"),
        ("level-weight = 1.0", "unknown key 'level-weight'; it is called 'level_weight'"),
        ("tolerance = 0.1", "tolerance: it is gone"),
        ('robust = true\nobjective = "minimax"', "robust analyses one video by each measure; leave out obj"),
        ('measures = "soft"', "measures soft is for --robust, which is missing"),
    ],
)
def test_a_wrong_key_is_told_as_one_of_the_file(command: Any, film: str, line: str, told: str) -> None:
    budget = "" if "budget" in line else "budget = 0.5\n"
    Path("request.toml").write_text(f'command = "optimize"\n[asked]\nvideo = "{film}"\n{budget}{line}\n')
    refused = command("optimize", "--request", "request.toml", "--out", "track")
    assert refused.code == 2
    assert refused.err.startswith("evenlight: request.toml: asked: " + told)
    assert refused.err.count("\n") == 1


def test_what_the_command_line_gives_is_told_as_an_option_beside_a_file_too(command: Any, film: str) -> None:
    Path("request.toml").write_text(f'command = "optimize"\n[asked]\nvideo = "{film}"\nbudget = 0.5\n')
    refused = command("optimize", "--request", "request.toml", "--calm", 7, "--out", "track")
    assert refused.err == "evenlight: --calm must lie in 0 to 1, got 7\n"
    refused = command("optimize", "--request", "request.toml", "--display", "none", "--out", "track")
    assert refused.err.startswith("evenlight: none: no such display")
    assert "asked in" not in refused.err


def test_what_is_to_be_given_is_an_option_and_what_of_it_the_file_asks_is_told(
    command: Any, film: str
) -> None:
    """The case reported: the names of a limit and a display of the file stand in the message by chance."""
    Path("request.toml").write_text(
        f'command = "optimize"\n[asked]\nvideo = "{film}"\nbudget = 0.5\nrate_limit = "surace2025"\n'
        'display = "laptop-lcd"\n'
    )
    refused = command("optimize", "--request", "request.toml", "--out", "track")
    assert refused.err.endswith(
        "give it as --rate-limit, or borrow this one, unproven there, with --other-display-ok (rate_limit: "
        "as asked in request.toml)\n"
    )
    Path("request.toml").write_text(
        f'command = "optimize"\n[asked]\nvideo = "{film}"\nbudget = 0.5\nobjective = "minimax"\n'
    )
    refused = command("optimize", "--request", "request.toml", "--robust", "--out", "track")
    assert refused.err == (
        "evenlight: --robust analyses one video by each measure; leave out --objective (objective: as asked "
        "in request.toml)\n"
    )


def test_what_a_word_of_the_file_happens_to_be_in_is_not_told_of_it(command: Any, film: str) -> None:
    """The unit of the file, "factor", stands in every message on factors."""
    Path("request.toml").write_text(
        f'command = "optimize"\n[asked]\nvideo = "{film}"\nbudget = 0.5\nbudget_unit = "factor"\n'
    )
    refused = command("optimize", "--request", "request.toml", "--budget", 2, "--out", "track")
    assert "budget 2" in refused.err
    assert "request.toml" not in refused.err


@pytest.mark.usefixtures("film")
def test_a_folder_without_a_request_is_told_so(command: Any) -> None:
    Path("of-python").mkdir()
    refused = command("optimize", "--request", "of-python", "--out", "track")
    assert (refused.code, "of-python: holds no request.toml: an earlier version" in refused.err) == (2, True)


def test_a_flag_that_is_on_in_a_file_is_switched_off_beside_it(command: Any, film: str) -> None:
    """`--no-robust` and `--player` undo `robust` and `no_player`; the help page shows neither."""
    Path("request.toml").write_text(
        f'command = "optimize"\n[asked]\nvideo = "{film}"\nbudget = 0.5\nrobust = true\n'
        "no_player = true\nno_cache = true\n"
    )
    off = ("--no-robust", "--player", "--quiet")
    made = command("optimize", "--request", "request.toml", *off, "--out", "track")
    assert made.code == 0, made.err
    asked = asked_in("track")["asked"]
    assert (asked["robust"], asked["no_player"], asked["no_cache"]) == (False, False, True)
    page = command("optimize", "--help").out
    assert "--robust" in page
    assert "--no-robust" not in page


def test_the_commands_that_leave_results_take_a_request() -> None:
    commands = {name: one for group in COMMANDS.values() for name, one in group.items() if callable(one)}
    taking = {name for name, one in commands.items() if "request" in inspect.signature(one).parameters}
    assert taking == {"optimize", "control", "catalogue", "judge", "fit", "analyze"}


def test_a_command_that_ends_with_a_failed_part_leaves_its_request_and_an_error_does_not(
    tmp_path: Path,
) -> None:
    def command(out: Path, failed: bool) -> None:
        with result_folder(out, "catalogue"):
            if not failed:
                raise InputError("no")
        raise typer.Exit(1)

    asked = recorded("catalogue", command)
    with pytest.raises(typer.Exit):
        asked(out=tmp_path / "some", failed=True)
    assert (tmp_path / "some" / "request.toml").is_file()
    with pytest.raises(InputError):
        asked(out=tmp_path / "none", failed=False)
    assert not (tmp_path / "none").exists()


def test_a_refused_command_leaves_no_request(command: Any, film: str) -> None:
    assert command("optimize", film, "--budget", 0.01, "--out", "track").code == 2
    assert not Path("track").exists()

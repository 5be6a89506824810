"""`evenlight reproduce`: every table and figure, each number with its origin, recorded data in their place.

The sequences are small patterns here; rendering has tests of its own.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from evenlight import command as command_line
from evenlight.analysis.reproduction import reproduction
from evenlight.data_schema.analysis_results import AnalysisSummary, Origin, Statistic
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import Provenance, sha256_of_bytes
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import Version
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.experiments.sessions.dataset import (
    new_dataset,
    write_description,
    write_participants,
    write_session,
)
from evenlight.method.preset_files import load_display

FRAMES = 30
SEQUENCES = ("library", "gym", "living_room", "basement")
RECORDED = ("01", "02", "03", "04")


class Pattern:
    """Grain of a contrast that grows, on a ground that brightens and darkens: something to lose."""

    def __init__(self, name: str) -> None:
        self.name, self.n_frames = name, FRAMES

    def frames(self) -> Iterator[Frame]:
        rng = np.random.default_rng(len(self.name))
        grain = rng.normal(size=(36, 64, 1))
        for k in range(FRAMES):
            ground = 90 + 70 * np.sin(2 * np.pi * k / FRAMES)
            pixels = np.clip(ground + (4 + k / 2) * grain, 0, 255).astype(np.uint8)
            yield Frame(k / 2, 0.5, np.repeat(pixels, 3, axis=2))

    def sha256(self) -> str:
        return sha256_of_bytes(self.name.encode())


def pattern(name: str, size: object = None, frames_per_second: object = None) -> Pattern:
    return Pattern(name)


def searched(participant: str, index: int) -> SearchTrial:
    """A search of one of three locations, in one of the versions; every fifth is in vain."""
    version, place = tuple(Version)[index % 2], index // 2
    found = (index + int(participant)) % 5 > 0
    return SearchTrial(
        participant_id=participant, session_id="01", trial_index=index, sequence="library",
        keypoint=("door", "desk", "shelf")[place], version=version,
        factor=0.5 if version is Version.BASELINE else 0.4 + 0.1 * place, ring_place=index % 2 + 1,
        ring_azimuth=10.0, ring_altitude=0.0, ring_gap=10.0, ring_contrast=-0.15, shown_contrast=-0.15,
        ring_orientation=90, background_luminance=30.0, gap_pixels=6.0, time_limit=30.0, found=found,
        search_time=4.0 + index + int(participant) if found else 30.0,
        reported_orientation=90 if found else None, response_time=None, simulated=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def lab(tmp_path_factory) -> Path:
    """A recorded data set of the search alone."""
    folder = tmp_path_factory.mktemp("recorded") / "lab"
    with new_dataset(folder) as staging:
        write_description(staging, "search", False, Provenance())
        write_participants(staging, list(RECORDED), simulated=False)
        for order, participant in enumerate(RECORDED):
            trials = [searched(participant, index) for index in range(6)]
            manifest = SessionManifest(
                participant, "01", "search", False, SessionStatus.COMPLETE, len(trials),
                load_display("varjo-xr3"), SearchDesign(sequences=("library",)), Provenance(), order,
            )  # fmt: skip
            write_session(staging, manifest, trials)
    return folder


def reproduced(lab: Path, out: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reproduction, "built_in_sequence", pattern)
        with pytest.raises(SystemExit) as ended:
            command_line.main(["reproduce", "--quick", "--data", str(lab), "--out", str(out), "--quiet"])
    assert not ended.value.code


@pytest.fixture(scope="module")
def folder(lab, coarse_pictures, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("reproduced") / "out"
    reproduced(lab, out)
    return out


def rows_of(folder: Path, part: str) -> list[Statistic]:
    return read_rows(Statistic, folder / "tables" / f"{part}_statistics.csv")


def test_every_table_and_figure_of_the_paper_is_there(folder) -> None:
    for part in (
        "at_a_glance",
        "slope_over_luminance",
        "detail_quality",
        "search",
        "adaptation",
        "power",
        "online",
    ):
        assert rows_of(folder, part), part
    figures = {path.stem for path in (folder / "figures").glob("*.png")}
    assert figures >= {
        "rate_limit", "thresholded_contrast", "checkerboard", "sunrise", "brightness_and_contrast_loss",
        "search_times", "adaptation_histogram", "online_walk", "online_target",
    }  # fmt: skip
    for name in figures:
        assert (folder / "figures" / f"{name}_points.csv").is_file(), name


def test_published_numbers_stand_beside_ours_and_every_origin_is_told(folder) -> None:
    rows = rows_of(folder, "detail_quality")
    for name in SEQUENCES:
        origins = {row.origin for row in rows if row.group == name}
        assert origins == {Origin.PUBLISHED, Origin.SIMULATED}, name
    printed = {row.what: row.value for row in rows if (row.group, row.origin) == ("gym", Origin.PUBLISHED)}
    assert printed["mean rating, baseline"] == 3.23  # Table 1
    assert printed["ours chosen"] == pytest.approx(0.47)
    adaptation = {row.origin for row in rows_of(folder, "adaptation")}
    assert adaptation == {Origin.PUBLISHED, Origin.COMPUTED}


def test_recorded_searches_take_the_place_of_simulated_ones(folder) -> None:
    origins = {row.origin for row in rows_of(folder, "search")}
    assert Origin.RECORDED in origins
    assert Origin.SIMULATED not in origins
    summary = read_json_record(AnalysisSummary, folder / "reproduction.json")
    assert summary.simulated
    page = (folder / "report.html").read_text()
    assert "4 recorded participants for search" in page
    assert "17 simulated participants for rating" in page
    assert not (folder / "pipeline" / "data" / "search").exists()


def test_every_number_of_the_table_of_the_report_is_in_a_table_of_its_own(folder) -> None:
    rows = rows_of(folder, "power")
    page = (folder / "report.html").read_text()
    for row in rows:
        assert row.value is not None
        assert f">{row.value:.3g}<" in page, row


def test_tables_and_figures_validate(folder, command) -> None:
    outcome = command("validate", folder)
    assert outcome.code == 0, outcome.out


def test_a_folder_with_data_of_others_is_left_alone(lab, command, tmp_path) -> None:
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline" / "mine.txt").write_text("mine")
    outcome = command("reproduce", "--out", tmp_path)
    assert outcome.code == 2
    assert "holds data that no reproduction made" in outcome.err
    assert (tmp_path / "pipeline" / "mine.txt").read_text() == "mine"


def test_what_cannot_be_used_is_refused_in_one_line(lab, command, tmp_path) -> None:
    for arguments, said in (
        (("--data", tmp_path / "nowhere"), "no such folder"),
        (("--seed", "-1"), "seed must be 0 or more, got -1"),
        (("--display", "nowhere"), "nowhere"),
        (("--data", lab, "--out", lab / "inside"), "lies in the data set"),
    ):
        place = () if "--out" in arguments else ("--out", tmp_path / "out")
        outcome = command("reproduce", *arguments, *place)
        assert outcome.code == 2
        assert said in outcome.err
        assert len(outcome.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()

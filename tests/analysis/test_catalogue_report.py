"""What a catalogue is reported as: its gallery leads to the results, wherever the report is."""

import re
from dataclasses import replace
from urllib.parse import unquote

import pytest
from made_summary import made_summary

from evenlight.analysis.catalogue.catalogue_report import Catalogue
from evenlight.analysis.catalogue.catalogue_results import in_words
from evenlight.data_schema.tracks.catalogue import CatalogueRow, row_of
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize("place", ["out", "elsewhere", "out/report", "a/b c"])
def test_the_gallery_leads_to_the_results_wherever_the_report_is(tmp_path, place):
    names = ("night walk", "sunrise")
    for name in names:
        (tmp_path / "out" / name).mkdir(parents=True)
        (tmp_path / "out" / name / "track.png").write_bytes(b"made")
    (tmp_path / "out" / "sunrise" / "player.html").write_text("made")
    found = Catalogue(tuple(CatalogueRow(name, f"{name}.mkv", frames=3) for name in names), tmp_path / "out")
    (found.write if place == "out" else found.save)(tmp_path / place)  # the command writes beside the results
    page = (tmp_path / place / "report.html").read_text()
    cards = re.findall(r'<li><a href="([^"]+)"><img [^>]*src="([^"]+)"', page)
    links = [unquote(link) for card in cards for link in card]
    ends = ["night walk/track.png", "night walk/track.png", "sunrise/player.html", "sunrise/track.png"]
    assert [(tmp_path / place / link).resolve() for link in links] == [tmp_path / "out" / end for end in ends]


def test_what_damage_cost_is_counted_for_each_video(tmp_path):
    films = (FilmReading(damaged=Damaged.SKIP, frames_skipped=3), FilmReading(), None)
    rows = [row_of("film", "film.ts", made_summary(film=film), 1.0) for film in films]
    assert [(row.frames_held, row.frames_skipped) for row in rows] == [(0, 3), (0, 0), (None, None)]
    said, _ = Catalogue(tuple(rows), tmp_path).first_lines
    assert said.endswith(". Of 1, damage cost pictures, which catalogue.csv counts.")


def test_what_differs_is_told_in_points_and_no_share_of_rounding_is():
    """1 - 0.0032/0.0036 = 11 %; at full brightness both losses are rounding."""
    row = row_of(
        "film", "film.mkv", made_summary(objective=0.0032, objective_baseline=0.0036, lower_bound=0.0), 1.0
    )
    told = "film: 100 frames, loss differs 11 % less than with constant dimming (0.32 points, constant 0.36)"
    assert in_words(row) == told
    assert in_words(replace(row, objective=3e-14, objective_baseline=4e-14)).endswith(", nothing to gain")

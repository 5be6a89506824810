"""Three newcomers' tasks, as scripts of their own commands: each sees what its script says, and no more."""

import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from optimized_videos import texture, video

import evenlight

SCRIPTS = sorted(Path(__file__).parent.glob("newcomers/*.sh"))
ANSWERS = pd.DataFrame({
    "participant_id": [1, 2, 3, 4, 5] * 2,
    "sequence": "library",
    "version": ["ours"] * 5 + ["baseline"] * 5,
    "rating": [4, 4, 5, 3, 4, 3, 4, 3, 2, 2],  # by the mean 1.2 points apart
})  # fmt: skip


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_newcomer_sees_what_the_script_says(
    script: Path, command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    video(Path("film.mkv"), [0.2 + 0.8 * texture(1)[:27] * k / 6 for k in range(1, 7)])  # 16:9
    ANSWERS.to_csv("answers.csv", index=False, sep=";")
    said = ""
    for line in script.read_text().splitlines():
        kind, _, words = line.partition(" ")
        if kind == "evenlight":
            done = command(*shlex.split(words))
            assert done.code == 0, done.err
            said = " ".join((done.out + done.err).split())
        elif kind == "#:":
            assert words in said
        elif kind == "#!":
            assert not re.search(words, said)
        elif kind != "#":
            assert subprocess.run(line, shell=True).returncode == 0, line


def test_a_researcher_in_a_notebook(tmp_path: Path) -> None:
    found = evenlight.analyze(ANSWERS)
    assert "1.20 points higher" in found.summary()
    assert found.plot("rating").axes[0].get_ylabel() == "rating (5 is best)"
    with evenlight.figures_as("svg"):
        found.save(tmp_path / "for-the-paper")
    assert "<text" in (tmp_path / "for-the-paper/rating.svg").read_text()

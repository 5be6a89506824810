"""`evenlight analyze` of simulated data says what was assumed, and concludes nothing from coin flips."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES


@pytest.mark.usefixtures("blank_pictures")
@pytest.mark.parametrize(
    ("swing", "coins"), [(0.0, True), (0.4, False)], ids=["a track that does not move", "one that swings"]
)
def test_the_report_on_simulated_comparisons(
    swing: float, coins: bool, tmp_path: Path, make_stimulus: Callable[..., None], command: Callable
) -> None:
    # At 5 Hz, of constant content: from 0.1 to 0.9 in 2 s, far above any threshold.
    for name in PAPER_SEQUENCES:
        make_stimulus(tmp_path / "stimuli" / name, 0.5 + swing * np.sin(np.arange(60) * np.pi / 10))
    data, out = tmp_path / "data", tmp_path / "out"
    simulated = ("simulate", "comparison", "--stimuli", tmp_path / "stimuli", "--participants", 8)
    assert command(*simulated, "--out", data, "--quiet").code == 0
    outcome = command("analyze", data, "--out", out)
    assert outcome.code == 0
    page = (out / "report.html").read_text()
    assert "Assumed and estimated" in page
    said = "By the assumed observer there is nothing to see"
    assert (said in page) == (said in outcome.out) == coins
    assert ("taken for the one that changed" in outcome.out) == (not coins)

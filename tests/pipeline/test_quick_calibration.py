"""The quick design, two levels: from the keys to a limit without a curve."""

import json
from pathlib import Path


def test_the_quick_design_goes_from_the_keys_to_a_limit(command, tmp_path: Path) -> None:
    """One factor on two screens: two levels, a line between them, and the warning before all others."""
    for who in ("01", "02"):
        ran = command(
            "run", "ramp", "--participant", who, "--session", "01", "--design", "quick", "--rig", "simulated",
            "--simulate", "data", "--out", tmp_path / "lab", "--quiet",
        )  # fmt: skip
        assert ran.code == 0, ran.err
    result = command("fit", tmp_path / "lab", "--out", tmp_path / "out", "--quiet")
    assert result.code == 0, result.err
    assert "two levels make no curve" in " ".join(result.err.splitlines()[:2])
    assert (tmp_path / "out" / "thresholds.csv").read_text().count("\n") == 1 + 4
    limit = json.loads((tmp_path / "out" / "rate_limit.json").read_text())
    assert (limit["model"], limit["form"], len(limit["coefficients"])) == ("joint", "log_log", 2)
    assert "the rate limit is not for use" in result.err.splitlines()[0]  # too few answers

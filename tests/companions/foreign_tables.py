"""Tables of trials as other programs write them, and what a refusal of one says."""

from pathlib import Path
from typing import Any

RATINGS = "participant,sequence,version,rating\na,gym,ours,4\na,gym,baseline,3\n"
SEARCHES = """\
vp;szene;ort;version;gefunden;zeit
1;library;Regal 1;ours;ja;3,25
1;library;Regal 1;baseline;nein;
2;library;Regal 1;ours;ja;2,5
2;library;Regal 1;baseline;nein;30
"""
SEARCH_OPTIONS = (
    "--column", "participant_id=vp", "--column", "sequence=szene", "--column", "keypoint=ort",
    "--column", "found=gefunden", "--value", "found:true=ja", "--value", "found:false=nein",
    "--column", "search_time=zeit", "--unit", "search_time=s", "--constant", "time_limit=30",
)  # fmt: skip
RAMPS = """\
Subject,L0,L1,dur_ms,still,answer
01,52.2,41.8,5000,0,y
01,52.3,41.9,5000,0,n
01,52.1,52.0,5000,1,n
01,20.9,18.8,2500,0,y
"""
RAMP_OPTIONS = (
    "--column", "initial_luminance=L0", "--unit", "initial_luminance=cd/m^2",
    "--column", "final_luminance=L1", "--unit", "final_luminance=nit",
    "--column", "duration=dur_ms", "--unit", "duration=ms", "--column", "is_catch=still",
    "--column", "response=answer", "--value", "response:yes=y", "--value", "response:no=n",
)  # fmt: skip


def refusal(outcome: Any, tmp_path: Path) -> str:
    """The one line of a refusal, without the folder of the test."""
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    return str(outcome.err.replace(f"{tmp_path}/", "").removeprefix("evenlight: ").strip())

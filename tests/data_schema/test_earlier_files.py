"""A file of every kind as version 9e153a4 wrote it: read with all that it says, or passed over.

`earlier_files.json` has their texts, made by that version from any record of the kind.
"""

import json
from pathlib import Path

import pytest

from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record

EARLIER = json.loads((Path(__file__).parent / "earlier_files.json").read_text())
GONE = {  # what CHANGELOG.md says is gone, part of another file, or read by a command alone
    *("agreement.csv", "control.json", "errors.csv", "judgement.csv", "power_table.csv", "tuning.json"),
    *("light.csv", "light_arrivals.csv", "light_flips.csv", "light_log.json", "light_results.json"),
    *("a_benchmark.csv", "a_growth.csv", "a_claims.csv", "benchmark.json", "target_sweep.csv"),
    *("a.catalogue.csv", "a.published.csv", "power_levels.csv"),
}


def written(name: str, folder: Path) -> Path:
    path = folder / name.partition("/")[2]
    path.write_text(EARLIER[name], encoding="utf-8")
    return path


@pytest.mark.parametrize("name", sorted(name for name in EARLIER if name.partition("/")[2] not in GONE))
def test_a_file_of_an_earlier_version_is_read_with_all_that_it_says(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    [checked] = validate(path)
    assert checked.problems == []
    if path.suffix in (".json", ".jsonl"):
        own, former = json.loads(EARLIER[name]), getattr(type(checked.record), "FORMER_KEYS", ())
        told = mapping_from_record(checked.record)
        assert {key: told.get(key) for key in own if key not in former} == {
            key: value for key, value in own.items() if key not in former
        }


@pytest.mark.parametrize("name", sorted(name for name in EARLIER if name.partition("/")[2] in GONE))
def test_a_file_that_is_no_kind_any_more_is_taken_for_no_other(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    [checked] = validate(tmp_path)
    assert (checked.words, checked.problems) == ("", [])
    with pytest.raises(InputError, match="nothing that Evenlight knows"):
        next(validate(path))

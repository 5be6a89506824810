"""Provenance: hashes that anybody can compute again, and versions."""

import hashlib
import subprocess
from pathlib import Path

import pytest

from evenlight.data_schema import provenance
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import (
    SCHEMA_VERSION,
    Provenance,
    provenance_now,
    sha256_of_bytes,
    sha256_of_file,
)


def test_the_hash_of_abc_is_the_published_one() -> None:
    """FIPS 180-2, appendix B.1."""
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256_of_bytes(b"abc") == expected


def test_the_hash_of_a_file_is_that_of_its_bytes_however_long(tmp_path: Path) -> None:
    content = b"0123456789abcdef" * 100_000  # 1.6 MB: more than one block
    (tmp_path / "f").write_bytes(content)
    assert sha256_of_file(tmp_path / "f") == hashlib.sha256(content).hexdigest()


def test_the_hash_of_a_folder_is_over_names_and_hashes_in_order(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "x.png").write_bytes(b"two")
    (tmp_path / "a.png").write_bytes(b"one")
    parts = b"a.png" + hashlib.sha256(b"one").digest() + b"b/x.png" + hashlib.sha256(b"two").digest()
    assert sha256_of_file(tmp_path) == hashlib.sha256(parts).hexdigest()


def test_a_folder_renamed_inside_has_another_hash_and_moved_as_a_whole_the_same(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "f.png").write_bytes(b"content")
    before = sha256_of_file(tmp_path / "one")
    assert sha256_of_file(tmp_path / "two") == before
    (tmp_path / "two" / "f.png").rename(tmp_path / "two" / "g.png")
    assert sha256_of_file(tmp_path / "two") != before


def test_a_missing_input_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere: no such file"):
        sha256_of_file(tmp_path / "nowhere")


def test_the_hash_of_a_record_is_of_its_content() -> None:
    same = [Display("d", 100.0, 0.1, 2.2, 30.0), Display("d", 100.0, 0.1, 2.2, 30.0)]
    assert sha256_of_record(same[0]) == sha256_of_record(same[1])
    assert sha256_of_record(same[0]) != sha256_of_record(Display("d", 100.0, 0.1, 2.3, 30.0))


def test_provenance_says_what_is_known() -> None:
    origin = provenance_now(seed=7, inputs={"video": "ab"})
    assert (origin.schema_version, origin.seed, origin.inputs) == (SCHEMA_VERSION, 7, {"video": "ab"})
    assert origin.versions["numpy"] == __import__("numpy").__version__


def test_a_module_outside_any_checkout_has_no_revision(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Installed below somebody's own repository, its revision must not be taken for ours."""
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    (tmp_path / "provenance.py").write_text("")
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    provenance._source_revision.cache_clear()
    try:
        assert provenance._source_revision() == "unknown"
    finally:
        provenance._source_revision.cache_clear()


@pytest.mark.parametrize("values", [{"seed": -1}, {"schema_version": 0}])
def test_provenance_has_limits(values: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="must be at least"):
        Provenance(**values)


def test_the_fingerprint_of_a_display_is_of_its_photometry_alone() -> None:
    display = Display("a", 100.0, 0.1, 2.2, 30.0, 0.5)
    expected = hashlib.sha256(b"100,0.1,2.2,0.5").hexdigest()[:16]
    assert display.fingerprint == expected
    assert Display("b", 100.0, 0.1, 2.2, 60.0, 0.5, source="x").fingerprint == expected
    assert Display("a", 100.0, 0.1, 2.3, 30.0, 0.5).fingerprint != expected

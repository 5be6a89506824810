"""The benchmark of dimmed files: its errors are those of files that it wrote, and of the definition."""

import pytest

from benchmarks import apply_subject
from benchmarks.measured import RunSettings
from benchmarks.records import Role


def test_every_codec_has_its_error_and_the_lossless_one_the_smallest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apply_subject, "QUICK_SIZE", (64, 48))
    monkeypatch.setattr(apply_subject, "QUICK_FRAMES", 4)
    measured = apply_subject.measure(RunSettings(quick=True))
    errors = {p.approach: p.error for p in measured.points}
    assert errors.pop(apply_subject.DEFINITION) is None
    assert set(errors) == set(apply_subject.NAMES.values())
    assert min(errors, key=lambda name: errors[name] or 0) == "FFV1, 10 bits, without loss"
    assert [p.role for p in measured.points].count(Role.DEFAULT) == 1
    assert measured.claims[0].measured == errors["FFV1, 10 bits, without loss"]

"""What the ranges of p over all pairings say, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evenlight.analysis.audit.audit_paired_tests import MAIN_TEST, PairedTest, PRange, Verdict
from evenlight.analysis.wording import listed, spaced

Ranges = Mapping[PairedTest, Sequence[PRange]]  # of each test, in the order of the sequences

_ONE = {
    Verdict.DIFFERS: "differs in every pairing",
    Verdict.NOT_SHOWN: "differs in none",
    Verdict.OPEN: "depends on the pairing",
}
_SEVERAL = {
    Verdict.DIFFERS: "differ in every pairing",
    Verdict.NOT_SHOWN: "differ in none",
    Verdict.OPEN: "depend on the pairing",
}


def verdicts_in_words(sequences: Sequence[str], ranges: Sequence[PRange]) -> str:
    """Return what a test says of each sequence.

    >>> sure, none = PRange(0.01, 0.02), PRange(0.2, 0.7)
    >>> verdicts_in_words(["library", "living_room", "basement"], [none, none, sure])
    'the basement differs in every pairing; the library and living room differ in none'
    """
    parts = []
    for verdict in Verdict:
        names = [spaced(s) for s, p in zip(sequences, ranges, strict=True) if p.verdict is verdict]
        if names:
            parts.append(f"the {listed(names)} {(_ONE if len(names) == 1 else _SEVERAL)[verdict]}")
    return "; ".join(parts)


def other_tests_in_words(sequences: Sequence[str], raw: Ranges, adjusted: Ranges) -> str:
    """Return where the other tests say something else than the main one, alone and after the correction.

    >>> sure, open_ = [PRange(0.01, 0.02)], [PRange(0.01, 0.2)]
    >>> raw = {PairedTest.SIGN_FLIP: sure, PairedTest.T: sure, PairedTest.SIGN: open_}
    >>> other_tests_in_words(["gym"], raw, raw | {PairedTest.SIGN: sure})
    'The other tests say the same, except that by itself the gym depends on the pairing in the sign test.'
    """
    others = [
        f"{when} the {spaced(sequence)} {_ONE[verdict]} in the {listed(tests)}"
        for when, ranges in (("by itself", raw), ("after the correction", adjusted))
        for place, sequence in enumerate(sequences)
        for verdict in Verdict
        if (tests := _dissenting(ranges, place, verdict))
    ]
    return "The other tests say the same" + (f", except that {'; '.join(others)}." if others else ".")


def _dissenting(ranges: Ranges, place: int, verdict: Verdict) -> list[str]:
    """Return the tests that give a sequence a verdict which the main test does not give it."""
    if ranges[MAIN_TEST][place].verdict is verdict:
        return []
    return [test.value.replace(", ", " with ") for test in ranges if ranges[test][place].verdict is verdict]

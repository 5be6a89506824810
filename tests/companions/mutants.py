"""Mutants of files: small damage of every kind that files meet, drawn from a seed."""

import io
import random
import re
import zipfile
from collections.abc import Callable

NUMBER = re.compile(rb"(?<![\w.\"])-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?![\w.])")
KEY = re.compile(rb"^\s*(\"?)(\w+)\1\s*[:=]|^(\w+)(?=,)", re.MULTILINE)
HOSTILE = [
    b"nan", b"NaN", b"inf", b"-Infinity", b"1e308", b"-1e308", b"1e-308", b"5e-324", b"1e400", b"-1", b"0",
    b"-0.0", b"1" + b"0" * 400, b"9" * 5000, b"1_000", b"0x10", "١٢".encode(), b" 1 ", b"1e3",
    b"9223372036854775808",
    b"1000000000", b'""', b"null", b"true", b"[]", b"{}", b'"x"', b"[" * 60 + b"]" * 60, b"[" * 100_000,
    b'{"a":' * 900 + b"1" + b"}" * 900, b"-", b"", b"\x00", b"\xff", b"2026-01-01",
    b"../../x", b"1,1", b"1\t1",
]  # fmt: skip
Mutation = Callable[[bytes, random.Random], bytes]


def _span(content: bytes, rng: random.Random) -> tuple[int, int]:
    start = rng.randrange(len(content) + 1)
    return start, min(len(content), start + rng.choice([1, 2, 7, 40, 300]))


def flipped(content: bytes, rng: random.Random) -> bytes:
    """One to four bits are another."""
    changed = bytearray(content)
    for _ in range(rng.randint(1, 4) if content else 0):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def truncated(content: bytes, rng: random.Random) -> bytes:
    """The end is missing, as after a crash; sometimes zeros stand in its place."""
    kept = content[: rng.randrange(len(content) + 1)]
    return kept + bytes(rng.choice([0, 0, 64]))


def duplicated(content: bytes, rng: random.Random) -> bytes:
    """A piece is there twice."""
    start, end = _span(content, rng)
    return content[:end] + content[start:end] + content[end:]


def cut(content: bytes, rng: random.Random) -> bytes:
    """A piece is missing."""
    start, end = _span(content, rng)
    return content[:start] + content[end:]


def spliced(content: bytes, rng: random.Random) -> bytes:
    """A piece of elsewhere in the file stands in place of another."""
    (start, end), (other, until) = _span(content, rng), _span(content, rng)
    return content[:start] + content[other:until] + content[end:]


def renumbered(content: bytes, rng: random.Random) -> bytes:
    """One number is a hostile one."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flipped(content, rng)
    match = rng.choice(found)
    return content[: match.start()] + rng.choice(HOSTILE) + content[match.end() :]


def rekeyed(content: bytes, rng: random.Random) -> bytes:
    """A key or a column has another name."""
    found = list(KEY.finditer(content))
    if not found:
        return duplicated(content, rng)
    match = rng.choice(found)
    start, end = match.span(2 if match[2] else 3)
    return (
        content[:start]
        + rng.choice([b"", b"x", content[start:end] * 2, b"name", b"__proto__"])
        + content[end:]
    )


def relined(content: bytes, rng: random.Random) -> bytes:
    """A line is missing, doubled, swapped with another, or half as long."""
    lines = content.split(b"\n")
    one, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(4)
    if change == 0:
        del lines[one]
    elif change == 1:
        lines.insert(one, lines[one])
    elif change == 2:
        lines[one], lines[other] = lines[other], lines[one]
    else:
        lines[one] = lines[one][: len(lines[one]) // 2]
    return b"\n".join(lines)


def reencoded(content: bytes, rng: random.Random) -> bytes:
    """Another encoding, line end, or nothing at all."""
    text = content.decode(errors="replace")
    return rng.choice(
        [
            text.encode("utf-16"), text.encode("utf-8-sig"), text.encode("latin-1", "replace"),
            b"", b"\n", b"\xef\xbb\xbf", b"\x00" + content, content + b"\x00" * 512, content.upper(),
            content.replace(b"\n", b"\r\n"), content.replace(b"\n", b"\r"), content.replace(b"\n", b""),
            content.replace(b",", b";"),
        ]
    )  # fmt: skip


def repacked(content: bytes, rng: random.Random) -> bytes:
    """A member of a zip archive is changed, with the checksums right: its header says another size, say."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(sorted(members))
    header, inside = members[name][:128], members[name][128:]
    change = rng.choice([renumbered, flipped, truncated, cut])
    members[name] = (change(header, rng) + inside) if rng.random() < 0.7 else header + change(inside, rng)
    if rng.random() < 0.2:
        del members[rng.choice(sorted(members))]
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for member, data in members.items():
            archive.writestr(member, data)
    return stream.getvalue()


ANY: tuple[Mutation, ...] = (flipped, truncated, duplicated, cut, spliced)
TEXT = (*ANY, renumbered, renumbered, renumbered, renumbered, rekeyed, relined, relined, reencoded)


def mutant(content: bytes, seed: str) -> bytes:
    """A mutant of a file: one change, sometimes two or three."""
    rng = random.Random(seed)
    if content[:2] == b"PK":
        kinds: tuple[Mutation, ...] = (*ANY, repacked, repacked, repacked)
    else:
        kinds = TEXT if b"\x00" not in content else ANY
    for number in range(rng.choice([1, 1, 1, 2, 3])):
        change = rng.choice(kinds if number == 0 else kinds[:5])
        content = change(content, rng)
    return content

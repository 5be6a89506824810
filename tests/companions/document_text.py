"""Reads the Markdown of README and docs for tests: blocks of code, links, headings, and sentences."""

import re
from itertools import pairwise
from pathlib import Path

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
# What begins a sentence: a capital, a digit, a symbol of the paper, a mark of emphasis, or a word of code.
SENTENCE_END = re.compile(r"(?<=[.!?])[)\"’”]* +(?=[A-ZÄÖÜ0-9(𝓛ŝ\u0370-\u03ff`*“\"]|code)")
FENCE = re.compile(r"^( *)(```+|~~~+)(.*)$")


def without_code(text: str) -> str:
    """Return the text with fenced and indented blocks left out, as empty lines."""
    kept, fence, indented, before = [], "", False, ""
    for line in text.split("\n"):
        mark = FENCE.match(line)
        if fence or mark:
            if mark and not fence:
                fence = mark[2]
            elif mark and mark[2].startswith(fence) and not mark[3].strip():
                fence = ""
            kept.append("")
        else:
            indented = line.startswith("    ") and (indented or not before.strip())
            kept.append("" if indented else line)
        before = line
    return "\n".join(kept)


def fences(text: str) -> list[tuple[str, str]]:
    """Return the language of each fenced block, or nothing, and its first line."""
    found, closing = [], ""
    lines = text.split("\n")
    for line, following in pairwise(lines):
        mark = FENCE.match(line)
        if mark and not closing:
            closing = mark[2]
            found.append((mark[3].strip(), following))
        elif mark and mark[2] == closing:
            closing = ""
    return found


def links(text: str) -> list[tuple[bool, str, str]]:
    """Return (is it a picture?, its words, its target) of each link outside of code."""
    prose = re.sub(r"`[^`\n]*`", "`code`", without_code(text))
    return [(bool(mark), words, target) for mark, words, target in LINK.findall(prose)]


def anchors(text: str) -> set[str]:
    """Return the anchors of a page's headings, as the site and usual viewers make them."""
    found: dict[str, int] = {}
    made = set()
    for heading in re.findall(r"^#+ +(.+)$", without_code(text), flags=re.MULTILINE):
        words = re.sub(r"[^\w\- ]", "", LINK.sub(r"\2", heading).strip().lower())
        anchor = words.replace(" ", "-")
        made.add(anchor if anchor not in found else f"{anchor}_{found[anchor]}")
        found[anchor] = found.get(anchor, 0) + 1
    return made


def sentences(text: str) -> list[str]:
    """Return the sentences of a page's paragraphs, items and cells, without code and the targets of links.

    A sentence ends at a full stop, an exclamation or question mark, or a colon that ends its paragraph. An
    item of a list, a heading and a cell of a table end it too. A semicolon or a colon does not.
    """
    prose = LINK.sub(r"\2", without_code(text))
    prose = re.sub(r"`[^`\n]*`", "code", prose)
    prose = re.sub(r"^\|[\s:|-]+\|$", "", prose, flags=re.MULTILINE)
    prose = re.sub(
        r"^\|(.*)\|$", lambda row: "\n\n" + row[1].replace("|", "\n\n") + "\n\n", prose, flags=re.MULTILINE
    )
    prose = re.sub(r"^ *([-*]|\d+\.|#+|>) +", "\n\n", prose, flags=re.MULTILINE)
    found = []
    for paragraph in re.split(r"\n\s*\n", prose):
        flat = re.sub(r"[*_]{1,2}(?=\S)|(?<=\S)[*_]{1,2}", "", " ".join(paragraph.split()))
        found += [part for part in SENTENCE_END.split(flat) if part]
    return found


def word_count(sentence: str) -> int:
    """Return the number of words: what stands between blanks and holds a letter or a digit."""
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def pages(root: Path) -> list[Path]:
    """Return README and all pages of docs."""
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]

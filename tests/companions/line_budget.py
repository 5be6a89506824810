"""How many lines product, content of scenes, tests and benchmarks have, and how many they may have.

`make check` runs it: `python tests/companions/line_budget.py`. The limits stand in `pyproject.toml`.
"""

import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
OTHERS = ("tests", "benchmarks")
PRODUCT = ("evenlight", "data_schema", "method", "hardware", "stimuli", "experiments", "analysis")
CONTENT = "stimuli/scenes/content/"  # it describes places
ADVICE = (
    "Say it with fewer lines, or take out what it makes superfluous: a table in place of tests that are "
    "alike, one place in place of two. Only where both fail, raise the limit in pyproject.toml, "
    "[tool.evenlight.lines], and say why in the commit."
)


def part_of(path: str) -> str | None:
    """Return what a Python file is a part of: the product, its content, tests or benchmarks."""
    folder = path.partition("/")[0]
    if not path.endswith(".py") or folder not in (*PRODUCT, *OTHERS):
        return None
    return folder if folder in OTHERS else "content" if path.startswith(CONTENT) else "product"


def lines_of(root: Path, paths: Iterable[str]) -> Counter[str]:
    """Return the number of lines of each part; links and files that are gone count nothing."""
    found: Counter[str] = Counter()
    for path in paths:
        part, file = part_of(path), root / path
        if part and file.is_file():
            found[part] += file.read_bytes().count(b"\n")
    return found


def report(lines: Counter[str], limits: dict[str, int]) -> tuple[str, bool]:
    """Return what to print, and whether every part keeps its limit."""
    told = [f"{part}: {lines[part]} lines of {limit}" for part, limit in limits.items()]
    above = [part for part, limit in limits.items() if lines[part] > limit]
    if above:
        told.append(f"Too many lines: {', '.join(above)}. {ADVICE}")
    return "\n".join(told), not above


def main() -> int:
    """Print the lines and their limits; return 1 where a part has more than it may."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    paths = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    limits = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["evenlight"]["lines"]
    text, kept = report(lines_of(ROOT, paths), limits)
    print(text, file=sys.stdout if kept else sys.stderr)
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())

"""The commands that pages show, as they stand there, with what they are said to print.

`python tests/companions/page_commands.py docs/first-hour.md` prints those of a page as a shell script.
"""

import itertools
import re
import shlex
import sys
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROGRAM = re.compile(r"(?:\.venv[/\\](?:bin|Scripts)[/\\])?evenlight(?= )")
RUN = re.compile(
    r"evenlight |make |export EVENLIGHT|pip install (?:-e )?examples/"
    r"|\S*python (?:-P )?-m (?:benchmarks|evenlight\.)"
)
# Other lines of a shell, by their first word, and why no test runs them.
NETWORK = "fetches packages from a network"
NOT_RUN = {
    ".": "activates an environment: the command is found without",
    "uv": NETWORK,
    "pipx": NETWORK,
    "python": NETWORK,
    "python3": "makes an environment, or " + NETWORK,
    "python3.12": "of macOS, which was not at hand",
    "~/evenlight/bin/python": NETWORK,
    "~/evenlight/bin/evenlight": "what was installed by the line before",
    "PIP_NO_INDEX=1": "a folder of packages is needed first, which " + NETWORK,
    "docker": "no engine of containers was at hand",
    "py": "of Windows, which was not at hand",
    ".venv\\Scripts\\Activate.ps1": "of Windows",
    ".venv\\Scripts\\evenlight.exe": "of Windows",
    "adb": "needs a phone",
    "ffmpeg": "a program of others; tests of `evenlight track export` run it",
    "mpv": "a program of others; tests of `evenlight track export` run it",
}
PROGRAMS = "sudo|apt|apt-get|brew|winget|conda|git|curl|wget|cd|source|set|npm|node|pip3?|bash|sh"
SHELL = re.compile(rf"\./|~/|\.venv|(?:{PROGRAMS})\s")  # the line is one of a shell, though it is not known
SHELLS = ("", "sh", "bash", "console", "powershell")  # languages of blocks


@dataclass(frozen=True)
class Step:
    """A command line of a page, or a block of Python."""

    page: str
    line: int
    text: str
    printed: tuple[str, ...] = ()  # what the page says that its block prints; … stands for a number

    @property
    def words(self) -> list[str]:
        """The words of the command line, without the shell's comment."""
        return shlex.split(self.text, comments=True)

    @property
    def is_python(self) -> bool:
        """Whether it is a block of Python."""
        return self.text.startswith("import evenlight")

    def __str__(self) -> str:
        """Return where it stands, and its first line."""
        return f"{self.page}:{self.line}: {self.text.partition(chr(10))[0]}"


@dataclass(frozen=True)
class Block:
    """A block of code: the language of its fence, the number of its first line, lines, the prose before."""

    language: str
    line: int
    lines: tuple[str, ...]
    before: str


def pages() -> list[str]:
    """Return the pages that readers read, the README first."""
    docs = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
    return ["README.md", *docs]


def blocks(page: str) -> list[Block]:
    """Return the blocks of code of a page: fenced ones, and those that are indented by four spaces."""
    found: list[Block] = []
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    at, before = 0, ""
    while at < len(lines):
        if lines[at].startswith("```"):
            end = next(k for k in range(at + 1, len(lines)) if lines[k].startswith("```"))
            found.append(Block(lines[at][3:].strip(), at + 2, tuple(lines[at + 1 : end]), before))
            at = end
        elif lines[at].startswith("    ") and (at == 0 or not lines[at - 1].strip()):
            end = at
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            found.append(Block("", at + 1, tuple(line[4:] for line in lines[at:end]), before))
            at = end - 1
        elif lines[at].strip():
            before = lines[at]
        at += 1
    return found


def steps(page: str) -> list[Step]:
    """Return the commands and the Python of a page, in order."""
    found: list[Step] = []
    for block in blocks(page):
        text = "\n".join(block.lines).strip()
        if block.language == "text" and found:  # what the command before it prints
            last = found.pop()
            found.append(replace(last, printed=tuple(filter(None, block.lines))))
        elif text.startswith("import evenlight") and block.language in ("", "python"):
            found.append(Step(page, block.line, text))
        elif block.language in SHELLS:
            found += [Step(page, line, text) for line, text in _lines(block) if RUN.match(text)]
    return found


def _lines(block: Block) -> list[tuple[int, str]]:
    """Return the lines of a block with their numbers; a backslash at the end of a line continues it."""
    found, text, begun = [], "", 0
    for number, line in enumerate(block.lines, start=block.line):
        begun = begun if text else number
        text += line.removeprefix("$ ").strip()
        if text.endswith("\\"):
            text = text[:-1]
            continue
        found.append((begun, PROGRAM.sub("evenlight", text, count=1)))
        text = ""
    return found


def other_lines(page: str) -> list[Step]:
    """Return the lines of a shell that are no steps: those that look like it, and what stands among them."""
    found: list[Step] = []
    for block in blocks(page):
        for is_text, lines in itertools.groupby(_lines(block), key=lambda line: bool(line[1])):
            together = [Step(page, *line) for line in lines if is_text and block.language in SHELLS]
            others = [step for step in together if not RUN.match(step.text)]
            if len(others) < len(together) or any(
                first_word(step) in NOT_RUN or SHELL.match(step.text) for step in others
            ):
                found += [step for step in others if not step.text.startswith("#")]
    return found


def first_word(step: Step) -> str:
    """Return the program of a line."""
    return step.text.split()[0]


def named_in_prose(page: str) -> list[Step]:
    """Return the commands that stand between backticks, in sentences and tables."""
    found: list[Step] = []
    fenced = False
    for number, line in enumerate((ROOT / page).read_text(encoding="utf-8").splitlines(), start=1):
        fenced ^= line.startswith("```")
        if not fenced:
            found += [Step(page, number, text) for text in re.findall(r"`(evenlight [^`]+)`", line)]
    return found


def page_file(page: str, name: str) -> str:
    """Return the text of a file that a page shows in a block that begins with its name, or comes after it."""
    for block in blocks(page) if page else []:
        if block.lines and (block.lines[0] == f"# {name}" or block.before.endswith(f"`{name}`:")):
            shown = itertools.takewhile(lambda line: not RUN.match(line), block.lines)
            return "\n".join(shown) + "\n"
    return ""


def script(page: str) -> str:
    """Return the files and commands of a page as a shell script."""
    parts = ["set -eux"]
    for block in blocks(page):
        text = "\n".join(block.lines).strip()
        if named := re.search(r"`([\w-]+\.\w+)`:$", block.before):
            parts.append(f"cat > {named[1]} <<'END'\n{text}\nEND")
        elif any(step.line in range(block.line, block.line + len(block.lines)) for step in steps(page)):
            parts.append(text if "import evenlight" not in text else f"python - <<'END'\n{text}\nEND")
    return "\n".join(parts)


if __name__ == "__main__":
    print(script(sys.argv[1]))

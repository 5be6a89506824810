"""How a command of a page is tried where it cannot be as it stands: few general rules, each with its reason.

A rule changes words of the command line and leaves the rest; what no rule changes runs literally.
"""

import functools
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import typer
from typer.main import get_command

from evenlight.command import app

PORT = re.compile(r"/dev/\S+|COM\d+|$")
BACKLIGHT = re.compile(r"(sysfs|ddc):\S+$")
SHORT = {
    "--seconds": "2", "--settle-s": "0.1", "--rounds": "2", "--interval-s": "0.1", "--passes": "1",
    "--horizon": "2",
}  # fmt: skip
SMALL = {"--participants": "4", "--size": "64x36", "--duration": "4", "--fps": "5"}

HERE = "workers-here"  # stands for the address of a cluster in the process of the tests

# Commands that are parsed and not run, by how they begin, with the reason.
PARSED = {
    "demo": "runs in tests/pipeline/test_demo.py, as it stands",
    "reproduce": "half an hour; its quick form runs in tests/pipeline/test_reproduce_command.py",
    "bench": "half an hour; tests/benchmarks has its parts",
    "plan ramp": "minutes; a small one runs in tests/analysis/test_planning.py",
    "plan search": "ten seconds; a small one runs in tests/analysis/test_viewing_plan.py",
    "fit shared": "the fit of before, again: tests/pipeline/test_exports_come_back.py compares them",
    "run search": "draws a school; tests/pipeline/test_viewing_sessions.py has a whole session",
    "run which_looks_better": "tests/pipeline/test_toy_task.py runs it, with its stimuli",
    "simulate which_looks_better": "the same",
    "validate pilot": "of that task: the same",
    "analyze pilot": "of that task: the same",
    "simulate rating": "needs the tracks of four sequences; tests/experiments simulates them",
    "play stimuli/library/video.mkv": "a walk of a minute; other videos are played",
    "watch lab": "waits for a session that runs; tests/experiments/test_live_view.py has one",
    "walk": "draws a house on a processor; tests/pipeline/test_walk_command.py does it",
    "optimize walk.json": "draws 150 pictures; tests/stimuli/test_gltf_scenes.py opens such a path",
    "render library --size": "draws a school for half a minute; docs/viewing-experiments.md has it smaller",
    "render house": "takes 10 s; tests/stimuli/test_gltf_scenes.py writes scenes and reads them",
    "render school": "the same",
    "render library --out library.glb": "the same",
    "live": "dims until it is ended; tests/experiments/test_live_loop.py has its parts",
    "measure saving": "minutes of a battery's gauge; tests/pipeline/test_measure_saving.py does it quickly",
}


def on_simulations(words: list[str]) -> None:
    """Instruments at a port are simulated; whose zero is set or who conform are drivers on emulated ones."""
    if words[:2] == ["measure", "conform"] and "--rig" in words:
        del words[words.index("--rig") : words.index("--rig") + 2]
    for k, word in enumerate(words):
        driver, colon, address = word.partition(":")
        if BACKLIGHT.match(word):
            words[k] = "simulated"
        elif colon and driver not in ("exec", "simulated", "battery") and PORT.match(address) and address:
            words[k] = f"simulated:{driver}" if words[1] in ("zero", "conform") else "simulated"
        elif word == "adb:":
            words[k] = "simulated"
    if words[:2] == ["measure", "headset"] and "--rig" not in words:
        words += ["--rig", "simulated-headset"]
    if words[:2] == ["measure", "power"] and "--out" in words:  # a file of simulated samples must say so
        at = words.index("--out") + 1
        words[at] = f"simulated-{words[at]}"


def without_a_person(words: list[str]) -> None:
    """Nobody sits there: a simulated observer answers a short session; without a window, as others try it."""
    if words[0] != "run":
        return
    if "--simulate" not in words:
        words += ["--simulate", "data"]
    words[words.index("--simulate") + 1] = "data"
    if "--real-time" in words:
        words.remove("--real-time")
    if "--design" not in words:
        words += ["--design", "quick"]
    elif "recommended" in words:
        words[words.index("recommended")] = "quick"


def in_a_window(words: list[str]) -> bool:
    """Return whether a command opens a window."""
    return words[0] == "play" or words[:2] == ["measure", "played"]


def on_a_simulated_window(words: list[str]) -> None:
    """A window would stay open for the length of a film: it counts the refreshes, as fast as it goes."""
    if in_a_window(words):
        words += ["--simulate"]


def in_a_made_up_headset(words: list[str]) -> None:
    """No runtime of a headset is here: tests/headset has one, where it can be."""
    words[:] = ["simulated-headset" if word == "headset.rig.toml" else word for word in words]
    if words[:2] == ["measure", "headset"] and "--rig" not in words:
        words += ["--rig", "simulated-headset"]


def on_a_dry_run(words: list[str]) -> None:
    """No player is opened to follow a film: tests/pipeline/test_follow_command.py has mpv."""
    if words[0] == "follow" and "--dry-run" not in words:
        words += ["--dry-run"]


def not_for_long(words: list[str]) -> None:
    """What is measured for seconds is measured for less, and fewer people are planned for or simulated."""
    for option, value in SHORT.items():
        if words[0] != "optimize" and option in words:
            words[words.index(option) + 1] = value
    if words[0] == "simulate":
        words[:] = _with(words, "--participants", "4")
    if words[0] == "plan":
        words += ["--quick"]
        words[:] = _with(words, "--participants", "8,12")


def on_workers_here(words: list[str]) -> None:
    """Each process of a cluster imports all there is: tests/pipeline/test_catalogue_killed.py has several."""
    if words[0] == "catalogue":
        words[:] = _with(words, "--cluster", HERE)


def in_small_pictures(words: list[str]) -> None:
    """A processor draws pictures of 64 x 36, one a second: a sequence of minutes in seconds."""
    if words[0] == "render" and words[words.index("--out") + 1].endswith(".mkv"):
        words[:] = _with(_with(words, "--size", "64x36"), "--fps", "1")


RULES: tuple[Callable[[list[str]], None], ...] = (
    on_simulations, without_a_person, on_a_simulated_window, in_a_made_up_headset, on_a_dry_run, not_for_long,
    on_workers_here, in_small_pictures,
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """How a command is tried: its words, the rules that changed them, or why it is parsed only."""

    words: tuple[str, ...]
    rules: tuple[str, ...] = ()
    parsed_only: str = ""

    @property
    def kind(self) -> str:
        """How it is tried, in a word."""
        return "parsed" if self.parsed_only else "variant" if self.rules else "literal"


def trial_of(words: list[str]) -> Trial:
    """Return how a command is tried, from its words after `evenlight`."""
    line = " ".join(words)
    for begin, reason in PARSED.items():
        if "--help" not in words and (line + " ").startswith(begin + " "):
            return Trial(tuple(words), parsed_only=reason)
    changed, rules = list(words), []
    for rule in RULES:
        before = list(changed)
        rule(changed)
        if changed != before:
            rules.append(rule.__name__)
    return Trial(tuple(changed), tuple(rules))


@functools.cache
def evenlight() -> Any:
    """Return the command line, which takes a fifth of a second to be put together."""
    return get_command(app)


def parse(words: list[str]) -> None:
    """Parse a command line, down to its last option, and run nothing."""
    command = evenlight()
    context: typer.Context | None = None
    name, rest = "evenlight", list(words)
    while hasattr(command, "resolve_command"):
        context = command.make_context(name, rest, parent=context)
        found, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        name = str(found)
    command.make_context(name, rest, parent=context)


def unknown_in(words: list[str]) -> str:
    """Return the first word that is no command or option, of a line where capitals stand for other words."""
    command = evenlight()
    rest = list(words)
    while rest and hasattr(command, "commands") and not rest[0].startswith("-"):
        word = rest.pop(0)
        if word.isupper():  # stands for any of them
            return ""
        if word not in command.commands:
            return word
        command = command.commands[word]
    options = {name for one in command.params for name in (*one.opts, *one.secondary_opts)} | {"--help"}
    return next(
        (word for word in rest if word.startswith("--") and word.partition("=")[0] not in options), ""
    )


def _with(words: list[str], option: str, value: str) -> list[str]:
    """Return the words with the value of an option, whether it was there or not."""
    if option not in words:
        return [*words, option, value]
    at = words.index(option) + 1
    return [*words[:at], value, *words[at + 1 :]]

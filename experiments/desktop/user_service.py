"""A service of systemd that dims the desktop in every session of its user."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole

NAME = "evenlight-live.service"


def unit_file() -> Path:
    """Return where the unit of this user is."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "systemd" / "user" / NAME


def unit(arguments: list[str]) -> str:
    """Return the unit that runs `evenlight live` with some arguments."""
    command = shlex.join([sys.executable, "-P", "-m", "evenlight", "live", *arguments, "--quiet"])
    command, here = (text.replace("%", "%%") for text in (command.replace("$", "$$"), str(Path.cwd())))
    return (
        "[Unit]\nDescription=Evenlight: the backlight follows what is on the screen\n"
        "PartOf=graphical-session.target\nAfter=graphical-session.target\n\n"
        f"[Service]\nWorkingDirectory={here}\nExecStart={command}\nRestart=on-failure\n"
        "RestartSec=10\nRestartPreventExitStatus=2\nNice=10\n\n"
        "[Install]\nWantedBy=graphical-session.target\n"
    )


def install(text: str) -> None:
    """Write a unit, and start it now and with each session; raise `InputError` where systemd refuses."""
    unit_file().parent.mkdir(parents=True, exist_ok=True)
    write_whole(unit_file(), text.encode())
    _systemctl("daemon-reload")
    _systemctl("enable", NAME)
    _systemctl("restart", NAME)  # or go on with other options


def uninstall() -> None:
    """Stop the service and remove its unit; raise `InputError` where there is none, or systemd refuses."""
    if not unit_file().is_file():
        raise InputError(f"there is no {unit_file()}: nothing is installed")
    _systemctl("disable", "--now", NAME)
    unit_file().unlink()
    _systemctl("daemon-reload")


def _systemctl(*words: str) -> None:
    if shutil.which("systemctl") is None:
        raise InputError("there is no systemctl: a user's service needs systemd")
    done = subprocess.run(["systemctl", "--user", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"systemctl --user {' '.join(words)}: {done.stderr.strip() or 'failed'}")

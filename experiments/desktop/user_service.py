"""A service of systemd that dims the desktop in every session of its user."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.whole_files import write_whole

NAME = "evenlight-live.service"


def unit_file() -> Path:
    """Return where the unit of this user is."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "systemd" / "user" / NAME


def installed(arguments: list[str]) -> bool:
    """Show the unit that runs `evenlight live` with some arguments; if wanted, start it now and later."""
    command = shlex.join([sys.executable, "-P", "-m", "evenlight", "live", *arguments])
    command, here = (text.replace("%", "%%") for text in (command.replace("$", "$$"), str(Path.cwd())))
    text = (
        "[Unit]\nDescription=Evenlight: the backlight follows what is on the screen\n"
        "PartOf=graphical-session.target\nAfter=graphical-session.target\n\n"
        f"[Service]\nWorkingDirectory={here}\nExecStart={command}\nRestart=on-failure\n"
        "RestartSec=10\nRestartPreventExitStatus=2\nNice=10\n\n"
        "[Install]\nWantedBy=graphical-session.target\n"
    )
    typer.echo(f"{unit_file()}:\n\n{text}")
    if not typer.confirm("Write this file, and start it now and with each session?"):
        return False
    unit_file().parent.mkdir(parents=True, exist_ok=True)
    write_whole(unit_file(), text.encode())
    _systemctl("daemon-reload", f"enable {NAME}", f"restart {NAME}")  # or go on with other options
    return True


def uninstall() -> None:
    """Stop the service and remove its unit; raise `InputError` where there is none, or systemd refuses."""
    if not unit_file().is_file():
        raise InputError(f"there is no {unit_file()}: nothing is installed")
    _systemctl(f"disable --now {NAME}")
    unit_file().unlink()
    _systemctl("daemon-reload")


def _systemctl(*commands: str) -> None:
    for command in commands:
        try:
            subprocess.run(
                ["systemctl", "--user", *command.split()], capture_output=True, text=True, check=True
            )
        except (OSError, subprocess.CalledProcessError) as error:  # there is none, or it refuses
            told = getattr(error, "stderr", None) or error
            raise InputError(f"systemctl --user {command}: {str(told).strip()}") from None

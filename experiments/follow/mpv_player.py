"""The player mpv, started or joined, through its JSON IPC socket.

Protocol: https://mpv.io/manual/stable/#json-ipc: a JSON object a line, answers and events mixed.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import socket
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.experiments.follow.playback_state import OBSERVED, PlaybackState
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError

STARTING = 30.0  # [s] that a player may take to say what it plays
OPENING = 3.0  # [s] that a player may play nothing before it opens its file
ENDING = 5.0  # [s] that it may take to end
LOOK = 0.02  # [s] between two looks at what it plays
CHUNK = 65536
REFUSED = 1  # mpv's exit code for options that it does not take
UNKNOWN = FilmReading()
NORMAL_ENDS = ("eof", "quit", "stop", "redirect")


class MpvPlayer(ContextDevice):
    """A player that plays the film.

    Parameters
    ----------
    connection : socket
        Connected to its IPC.
    video : Path
        The film.
    times : array, (N,)
        When its frames appear [s].
    process : Popen, optional
        The player, if it was started here: it is ended with this.
    reading : FilmReading
        Which of the file's videos it is, and where its stamps begin.
    """

    def __init__(
        self,
        connection: socket.socket,
        video: Path,
        times: Array,
        process: subprocess.Popen[bytes] | None = None,
        reading: FilmReading = UNKNOWN,
    ) -> None:
        self._connection, self._video, self._process, self._reading = connection, video, process, reading
        self._name, self._rest, self._gone = "mpv", b"", False
        self.state = PlaybackState(times, self._is_film, reading.file_start)
        for number, name in enumerate((*OBSERVED, "track-list"), start=1):
            self._send("observe_property", number, name)

    def wait(self, seconds: float) -> None:
        """Take what the player says for some time [s]."""
        end = time.monotonic() + seconds
        while not self._gone:
            if not select.select([self._connection], [], [], max(end - time.monotonic(), 0.0))[0]:
                return
            try:
                got = self._connection.recv(CHUNK)
            except ConnectionError:
                got = b""
            self._gone = not got
            *lines, self._rest = (self._rest + got).split(b"\n")
            now = time.monotonic()
            for line in lines:
                try:
                    message = json.loads(line)
                except ValueError:  # a line that is no message is none of ours
                    continue
                if isinstance(message, dict):
                    self.state.take(message, now)
                    if message.get("name") == "track-list":
                        self._choose(message.get("data") or [])
        time.sleep(max(end - time.monotonic(), 0.0))

    def ended(self) -> bool:
        """Return whether the player has ended.

        Raises
        ------
        InputError
            If it does not take the options that it was started with.
        InstrumentError
            If it did not end by itself or by its user, or cannot play the film.
        """
        if self.state.ended == "error" and self._process is not None:
            raise InstrumentError(
                f"mpv cannot play {self._video}: {self.state.error or 'it does not say why'}"
            )
        if not self._gone:
            return False
        if self.state.ended not in NORMAL_ENDS:
            code = self._exit_code()
            if code == REFUSED and not self.state.playing:
                raise InputError("mpv refuses its options: see --player-arguments; or it is older than 0.33")
            words = "" if code is None else f" (signal {-code})" if code < 0 else f" (exit code {code})"
            raise InstrumentError(f"the player died{words} while it played", Fault.DISCONNECTED)
        return True

    def require_film(self) -> None:
        """Wait until the player says that it plays the film; refuse another one.

        Raises
        ------
        InputError
            If it plays something else, or nothing.
        InstrumentError
            If it does not say, or ends.
        """
        begun = time.monotonic()
        while not self.state.plays_film:
            self.wait(LOOK)
            waited = time.monotonic() - begun
            # A player that is about to open a file says for a moment that it plays nothing.
            if self.state.plays_film is False and (self.state.playing or waited > OPENING):
                raise InputError(
                    f"the player plays {self.state.playing or 'nothing'}, not {self._video}: open that in it"
                )
            if self.ended() or waited > STARTING:
                raise InstrumentError(f"the player does not play {self._video}", Fault.NO_REPLY)

    def go_on(self) -> None:
        """Let a paused film play."""
        self._send("set_property", "pause", False)

    def close(self) -> None:
        """End the player if it was started here, else only leave it; more than once does nothing."""
        super().close()
        self._connection.close()
        if self._process is not None:
            end_process(self._process)

    def _send(self, *command: object) -> None:
        """Send a command; a player that is gone is noticed when it is listened to."""
        with contextlib.suppress(OSError):
            self._connection.sendall(json.dumps({"command": command}).encode() + b"\n")

    def _choose(self, tracks: list[dict[str, Any]]) -> None:
        """Have that of several videos played that the track is for."""
        for track in tracks:
            if track.get("type") == "video" and track.get("ff-index") == self._reading.stream:
                self._send("set_property", "vid", track["id"])

    def _is_film(self, path: str, folder: str) -> bool:
        """Return whether a path, as the player has it, is the film's."""
        try:
            return Path(folder, path).samefile(self._video)
        except (OSError, ValueError):
            return False

    def _exit_code(self) -> int | None:
        """Return how the process ended; None if it was not started here, or takes too long."""
        if self._process is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self._process.wait(ENDING)
        return None


def join_mpv(path: Path, video: Path, times: Array, reading: FilmReading = UNKNOWN) -> MpvPlayer:
    """Return a player that runs and plays the film, by its IPC socket; closing this leaves it running.

    Raises
    ------
    InputError
        If no player listens there, or it plays something else.
    InstrumentError
        If it does not say what it plays, or ends.
    """
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.connect(os.fspath(path))
    except OSError as error:
        connection.close()
        raise InputError(
            f"--socket {path}: no player listens there ({error.strerror or error}); start one with "
            f"mpv --input-ipc-server={path} {video}"
        ) from None
    return _playing(MpvPlayer(connection, video, times, reading=reading))


def start_mpv(
    video: Path, times: Array, arguments: Sequence[str] = (), reading: FilmReading = UNKNOWN
) -> MpvPlayer:
    """Return a player that plays the film, started with more arguments, in a session of its own.

    It has one end of a pair of sockets, which nobody else can reach, and quits when ours is closed, as the
    system does when we are killed: https://mpv.io/manual/stable/#options-input-ipc-client.

    Raises
    ------
    InputError
        If mpv is not installed, or does not take the arguments.
    InstrumentError
        If it ends before it plays the film.
    """
    program = shutil.which("mpv")
    if program is None:
        raise InputError("mpv is not installed (on Debian: apt install mpv); or join one with --socket")
    ours, its = socket.socketpair()
    with its:
        words = [f"--input-ipc-client=fd://{its.fileno()}", "--no-terminal", "--idle=no", *arguments]
        process = subprocess.Popen(
            [program, *words, "--", os.fspath(video)], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL, start_new_session=True, pass_fds=[its.fileno()],
        )  # fmt: skip
    return _playing(MpvPlayer(ours, video, times, process, reading))


def _playing(player: MpvPlayer) -> MpvPlayer:
    """Return a player once it plays the film."""
    try:
        player.require_film()
    except BaseException:
        player.close()
        raise
    return player


def end_process(process: subprocess.Popen[bytes]) -> None:
    """End a process, by force if it does not want to."""
    process.terminate()
    try:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(ENDING)
    finally:
        process.kill()
        process.wait()

"""A photodiode at the input of a sound card, recorded by `arecord` of ALSA; its input is AC-coupled.

Not tried with a photodiode: tested with a program that stands in for arecord.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence

import numpy as np

from evenlight.hardware.drivers.power_sampling import require_sample_rate
from evenlight.hardware.protocols import ContextDevice, Fault, InstrumentError, LightBlock, LightStream

PROGRAM = "arecord"
OWN_RATE, SLOWEST, FASTEST = 48_000.0, 8000.0, 192_000.0  # [Hz]
FULL_SCALE = 32_768  # of 16 bits
SAMPLE_BYTES = 2
AT_ONCE = 1 << 20  # bytes
SILENCE = 2.0  # [s] without a sample: a sound card gives some all the time


class SoundCard(ContextDevice):
    """A sound card: it counts samples, and has no other clock.

    Parameters
    ----------
    address : str
        Its name for ALSA, as `arecord -L` has them; empty for the default.
    clock : callable, optional
        The computer's clock, for arrivals [s].
    """

    def __init__(self, address: str = "", clock: Callable[[], float] = time.monotonic) -> None:
        self._device, self._clock = address or "default", clock
        self._name = f"the sound card {self._device}"
        self._process: subprocess.Popen[bytes] | None = None
        self._rate, self._count, self._rest, self._heard = OWN_RATE, 0, b"", 0.0
        if shutil.which(PROGRAM) is None:
            raise InstrumentError(
                f"{self._name}: needs the program {PROGRAM}; on Debian: apt install alsa-utils",
                Fault.NOT_FOUND,
            )

    def start(self, rate: float | None) -> LightStream:
        """Begin to record at a rate [Hz], and return what comes."""
        self._require_open()
        self._stop()
        self._rate = OWN_RATE if rate is None else rate
        require_sample_rate(self._rate, SLOWEST, FASTEST, self._name)
        if self._rate % 1:
            raise InstrumentError(f"{self._name}: samples at whole rates, got {self._rate:g} Hz")
        form = ["-q", "-D", self._device, "-t", "raw", "-f", "S16_LE", "-c", "1", "-r", f"{self._rate:.0f}"]
        self._process = subprocess.Popen([PROGRAM, *form], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._count, self._rest, self._heard = 0, b"", time.monotonic()
        return LightStream(self._rate, full_scale=1.0, dc_coupled=False)

    def samples(self) -> Sequence[LightBlock]:
        """Return the samples that came since the last call."""
        self._require_open()
        if self._process is None or self._process.stdout is None:
            raise InstrumentError(f"{self._name}: is not sampling; start it first")
        came = self._rest + (self._process.stdout.read(AT_ONCE) or b"")
        received = self._clock()
        whole = len(came) // SAMPLE_BYTES
        codes, self._rest = np.frombuffer(came, "<i2", whole), came[whole * SAMPLE_BYTES :]
        if not whole:
            self._require_alive()
            return []
        self._heard = time.monotonic()
        times = (self._count + np.arange(whole)) / self._rate
        self._count += whole
        return [LightBlock(times, codes / FULL_SCALE, received)]

    def ping(self) -> None:
        """Return None: a sound card answers no questions."""
        self._require_open()

    def apparatus(self) -> dict[str, str]:
        """Return what is known of the sampler."""
        return {"light_sampler": f"{self._name}, through {PROGRAM}; AC-coupled"}

    def close(self) -> None:
        """End the recording; more than once does nothing."""
        super().close()
        self._stop()

    def _stop(self) -> None:
        """End the program."""
        if self._process is not None:
            process, self._process = self._process, None
            process.terminate()
            process.communicate()

    def _require_alive(self) -> None:
        """Refuse a program that has ended, or is silent."""
        assert self._process is not None
        ended = self._process.poll() is not None
        if ended or time.monotonic() - self._heard > SILENCE:
            said = self._process.stderr.read() if ended and self._process.stderr else b""
            words = " ".join(said.decode(errors="replace").split())[:200] or f"no sample for {SILENCE:g} s"
            raise InstrumentError(
                f"{self._name}: {PROGRAM} {'ended' if ended else 'is silent'}: {words}",
                Fault.DISCONNECTED if ended else Fault.NO_REPLY,
            )

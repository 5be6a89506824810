"""Triggers as a marker stream of the lab streaming layer (LSL), for recorders in the network."""

from __future__ import annotations

from evenlight.hardware.protocols import ContextDevice, Fault


class LslTrigger(ContextDevice):
    """Sends labels as markers, with the time of LSL's own clock.

    Parameters
    ----------
    name : str
        Of the stream, by which a recorder finds it.

    Raises
    ------
    InstrumentError
        If pylsl is not installed, or its library cannot be loaded.
    """

    def __init__(self, name: str) -> None:
        self._name = f"the LSL stream {name!r}"
        try:
            import pylsl
        except (ImportError, RuntimeError, OSError) as error:  # the last two: without the library liblsl
            words = f"pylsl cannot be used ({error}); install it with: pip install '.[lsl]' in the checkout"
            raise self._error(words, Fault.NOT_FOUND) from None
        rate, text = pylsl.IRREGULAR_RATE, pylsl.cf_string
        info = pylsl.StreamInfo(name, "Markers", 1, rate, text, source_id=f"evenlight-{name}")
        self._outlet = pylsl.StreamOutlet(info)
        self._version = str(pylsl.library_version())

    def send(self, code: int, label: str) -> None:
        """Send the label."""
        self._require_open()
        self._outlet.push_sample([label])

    def apparatus(self) -> dict[str, str]:
        """Return what it sends, and the version of the library."""
        return {"sends": "labels as markers", "liblsl": self._version}

    def close(self) -> None:
        """End the stream."""
        self._outlet = None
        super().close()

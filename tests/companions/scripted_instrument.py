"""An instrument that knows one dialogue by heart: which bytes a driver sends and takes, exactly."""

from __future__ import annotations

from collections.abc import Sequence


class ScriptedInstrument:
    """Answers the commands of a script, in its order, and nothing else.

    Parameters
    ----------
    script : sequence of (bytes, bytes)
        What is to be sent, and what is answered.
    """

    def __init__(self, script: Sequence[tuple[bytes, bytes]]) -> None:
        self._left, self._came = list(script), b""

    def receive(self, data: bytes) -> bytes:
        """Take some bytes that were sent, and answer those that are next in the script.

        Raises
        ------
        ValueError
            If they are others.
        """
        self._came += data
        answers = b""
        while self._came:
            if not self._left:
                raise ValueError(f"the script is over, and {self._came!r} was sent")
            expected, answer = self._left[0]
            if self._came.startswith(expected):
                self._came = self._came[len(expected) :]
                del self._left[0]
                answers += answer
            elif expected.startswith(self._came):
                break  # a part of it
            else:
                raise ValueError(f"expected {expected!r}, and {self._came!r} was sent")
        return answers

    def stream(self) -> bytes:
        """Return nothing: it speaks when it is asked."""
        return b""

    def is_over(self) -> bool:
        """Return whether the script was played to its end."""
        return not self._left

    def finish(self) -> None:
        """Refuse a script that was not played to its end."""
        if self._left or self._came:
            raise ValueError(f"not sent: {[expected for expected, _ in self._left]}; left: {self._came!r}")

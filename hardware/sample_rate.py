"""Sample rates of power meters: what an instrument has not is refused."""

from __future__ import annotations

from evenlight.hardware.protocols import InstrumentError

ROUNDING = 1e-9  # of a rate that was computed


def require_sample_rate(rate: float, lowest: float, highest: float, device: str) -> None:
    """Refuse a sample rate that a power meter has not; nothing is clipped.

    Parameters
    ----------
    rate : float
        What was asked for [Hz].
    lowest, highest : float
        What there is [Hz].
    device : str
        The instrument, as messages name it.

    >>> require_sample_rate(100.0, 1.0, 1000.0, "the meter")
    """
    if not lowest * (1 - ROUNDING) <= rate <= highest * (1 + ROUNDING):
        raise InstrumentError(f"{device}: samples at {lowest:g} to {highest:g} Hz, got {rate:g} Hz")

"""What `evenlight measure list` says of a driver."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DriverNote:
    """A driver, as the person at the bench needs to know it.

    Attributes
    ----------
    name : str
        Of the driver, as rig files and commands name it.
    instrument : str
        What it drives.
    address : str
        The form of its address, e.g. "ls100:PORT".
    settings : str
        Of the line and of the instrument, in words.
    usb_ids : tuple of (int, int), optional
        Vendor and product numbers that the instrument has on USB, where they are known.
    note : str, optional
        What else to know: an extra or a program to install, what is not confirmed.
    """

    name: str
    instrument: str
    address: str
    settings: str
    usb_ids: tuple[tuple[int, int], ...] = ()
    note: str = ""

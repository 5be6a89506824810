"""Whether the instruments of a resumed sweep are those that it began with, be it at another port."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.sweep import SweepManifest
from evenlight.hardware.rig import is_simulated
from evenlight.hardware.rig_files import TABLE

KINDS = {"luminance meter": "luminance_meter", "power meter": "power_meter"}  # with the rig's name of each
MODEL, SERIAL = ("model", "power_meter"), ("serial number", "power_meter_serial")
PORT = re.compile(r"(/dev/|COM\d|socket://)")  # which a cable that was pulled may change


def without_addresses(rig: Rig) -> Rig:
    """Return a rig whose meters are all at the address 0, with what is set there (`?...`).

    >>> without_addresses(Rig("a", "b", 0.6, 60.0, power_meter="ppk2:/dev/ttyACM0?voltage=5.0")).power_meter
    'ppk2:0?voltage=5.0'
    """
    shared = rig.backlight == rig.power_meter  # one board, on one link
    return dataclasses.replace(
        rig,
        luminance_meter=_without_address(rig.luminance_meter),
        power_meter=_without_address(rig.power_meter),
        backlight=_without_address(rig.backlight) if shared else rig.backlight,
    )


def _without_address(name: str) -> str:
    """Return the name of an instrument, at the address 0."""
    driver, colon, address = name.partition(":")
    if not colon or is_simulated(name) or name.startswith(TABLE):
        return name
    return f"{driver}:0" + "".join(address.partition("?")[1:])


def known_again(manifest: SweepManifest, rig: Rig, apparatus: Mapping[str, str]) -> list[str]:
    """Return in words which instruments are at another address than when the sweep began.

    Parameters
    ----------
    manifest : SweepManifest
        As the sweep began, or was last resumed.
    rig : Rig
        What it is resumed with.
    apparatus : mapping of str to str
        What the instruments say of themselves now.

    Raises
    ------
    InputError
        If one is another instrument, or nothing tells that it is the same.
    """
    moved = []
    for kind, field in KINDS.items():
        now, was = _said(apparatus, kind), _said(manifest.apparatus, kind)
        began, name = getattr(manifest.rig, field), getattr(rig, field)
        for key in (*MODEL, *SERIAL):
            if was and now and was.get(key) != now.get(key):
                before, there = (said.get(key, f"without {key}") for said in (was, now))
                raise InputError(
                    f"sweep {manifest.session_id} began with the {kind} {before!r}, and {name} is {there!r}; "
                    "connect the one it began with, or give another --session"
                )
        if name == began or not now:
            continue
        serial = _serial_number(now) if was else ""
        if not serial and not (PORT.match(_address(name)) and PORT.match(_address(began))):
            raise InputError(
                f"sweep {manifest.session_id} began with the {kind} {began}, and nothing tells that {name} "
                "is the same one: it has no serial number; connect it as it was, or give another --session"
            )
        told = f"serial number {serial}" if serial else "driver and model; it tells no serial number"
        moved.append(f"the {kind} is at {name}, and was at {began}: the same by its {told}")
    return moved


def _said(apparatus: Mapping[str, str], kind: str) -> dict[str, str]:
    return {
        key.removeprefix(f"{kind}: "): text for key, text in apparatus.items() if key.startswith(f"{kind}: ")
    }


def _serial_number(said: Mapping[str, str]) -> str:
    """Return the serial number that an instrument tells, by itself or as the third word of `*IDN?`."""
    identity = said.get("power_meter", "").split(",")
    own = next((said[key] for key in SERIAL if key in said), identity[2] if len(identity) == 4 else "")
    return own.strip().strip("0") and own.strip()


def _address(name: str) -> str:
    return name.partition(":")[2]

"""The luminance meters that there are drivers for, as the person at the bench needs to know them."""

from __future__ import annotations

from evenlight.hardware.driver_notes import DriverNote

REMOTE_7E2 = "4800 baud, 7 data bits, even parity, 2 stop bits; hold F while switching it on"
PHOTO_RESEARCH = "9600 baud, 8N1"
COLORCAL_USB = (0x0861, 0x1001)  # 2145, 4097

LUMINANCE_METERS: tuple[DriverNote, ...] = (
    DriverNote("ls100", "Konica Minolta LS-100", "ls100:PORT", REMOTE_7E2),
    DriverNote("ls110", "Konica Minolta LS-110", "ls110:PORT", REMOTE_7E2),
    DriverNote("cs100a", "Konica Minolta CS-100A", "cs100a:PORT", REMOTE_7E2),
    DriverNote("pr655", "Photo Research PR-655", "pr655:PORT", PHOTO_RESEARCH),
    DriverNote("pr670", "Photo Research PR-670", "pr670:PORT", PHOTO_RESEARCH),
    DriverNote(
        "pr650",
        "Photo Research PR-650",
        "pr650:PORT",
        f"{PHOTO_RESEARCH}; switch it off and on, and connect within 5 s",
    ),
    DriverNote(
        "colorcal",
        "CRS ColorCAL II",
        "colorcal:PORT",
        "USB, any baud rate; its zero is set with the sensor covered",
        usb_ids=(COLORCAL_USB,),
    ),
    DriverNote(
        "spotread",
        "any colorimeter or spectrometer that ArgyllCMS knows",
        "spotread: or spotread:NUMBER",
        "the program `spotread` of ArgyllCMS; NUMBER is that of its list, 1 if left out",
        note="install it with: apt install argyll",
    ),
    DriverNote(
        "manual",
        "any meter that is read by eye",
        "manual",
        "readings are typed in, in cd/m^2; u for under range, o for over range, stop to end",
    ),
    DriverNote(
        "csv",
        "a table of readings made elsewhere",
        "csv:FILE",
        "columns pixel_value,luminance_cd_m2 and, where the brightness was varied, factor",
        note="named in a rig, and imported by `evenlight run luminance-sweep`",
    ),
    DriverNote(
        "simulated",
        "a simulated luminance meter, looking at the simulated panel",
        "simulated, or simulated:DRIVER for a driver on its emulated instrument",
        "a spot meter of 4 digits",
    ),
)

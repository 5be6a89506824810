"""Drivers of instruments and backlights, and the links that they speak over (see `hardware.driver_table`)."""

"""A desktop dimmed live: each monitor's backlight by what is on it."""

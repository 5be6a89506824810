"""Instruments: luminance meters, power meters, backlights, screen timing (none is driven yet)."""

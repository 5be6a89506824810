"""Sweeps of a display: luminance and power, level by level, with instruments."""

"""Luminance and power sweeps: display and power models from the readings of a meter."""

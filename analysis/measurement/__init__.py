"""Displays and power, measured: sweeps, the energy of frames, clocks."""

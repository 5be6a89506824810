"""Devices: window, keys and backlight of a session, their simulations, and the rig that names them."""

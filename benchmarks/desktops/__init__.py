"""Desktops with real windows on a virtual X server: recorded, dimmed again on a simulated panel, and live."""

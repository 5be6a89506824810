"""Instruments that are not there: they speak the same bytes, over a real socket or pseudo-terminal."""

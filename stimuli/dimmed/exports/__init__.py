"""Tracks for other programs: FFmpeg, mpv, an edit, and anything that reads JSON."""

"""Brightness tracks: from a video to its files and figures, offline and online."""

"""Integrity before inference: what is wrong with the trials of a task, before any inference."""

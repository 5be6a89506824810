"""Conducting a session: its stage, pages, participant and files, the same for every experiment."""

"""Things that stand in more than one place."""

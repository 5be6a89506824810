"""What the experimenter sees of a session while it runs."""

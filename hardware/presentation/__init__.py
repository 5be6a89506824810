"""The window, keys and pointer of a session, and simulated keys and pointers."""

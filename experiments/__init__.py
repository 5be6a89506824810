"""Sessions with participants, real or simulated: designs, observers, tasks."""

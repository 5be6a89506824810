"""What experiments and instruments record: designs, sessions, trials, sweeps, power."""

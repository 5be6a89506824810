"""Simulated devices in this process: a physical panel, the meters that look at it, clocks of rehearsals."""

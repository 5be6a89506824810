"""Data sets in the layouts of BIDS and Psych-DS (`evenlight export`)."""

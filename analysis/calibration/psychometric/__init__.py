"""Psychometric fits: answers counted, functions and thresholds fitted, how far they can be trusted."""

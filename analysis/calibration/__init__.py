"""Calibration: psychometric fits, thresholds, the rate limit, and planning for it."""

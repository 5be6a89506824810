"""From trials to thresholds, rate limits, figures and reports."""

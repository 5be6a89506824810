"""Temporal brightness management: dim a display over time, to a power budget, within a rate limit."""

"""The rate limit ΔL(L): fitted to thresholds, and the curves that it could be instead."""

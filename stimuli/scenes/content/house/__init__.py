"""The house and what stands in it."""

"""The school and what stands in it."""

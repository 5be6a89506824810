"""Procedurally made places, the light in them, and walks through them."""

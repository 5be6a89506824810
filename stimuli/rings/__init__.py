"""Landolt rings in scenes: their shape and light, where they are hidden, and looking around for them."""

"""Scenes on the graphics processor, and their pictures."""

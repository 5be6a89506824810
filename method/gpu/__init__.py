"""Contrast loss on the graphics processor, by compute shaders."""

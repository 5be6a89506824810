"""A task of its own for Evenlight, and designs: those in this folder are presets, by their names."""

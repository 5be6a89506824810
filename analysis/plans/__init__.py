"""Plans of the viewing experiments: participants for a wanted power."""

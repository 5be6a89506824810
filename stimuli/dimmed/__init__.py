"""Videos dimmed by their tracks: as files, and as recipes for other programs."""

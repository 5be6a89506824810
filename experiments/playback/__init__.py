"""Playing on a window: videos with their tracks, measured power, and walks that are dimmed live."""

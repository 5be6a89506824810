"""What the two eyes of a headset see: text and flat or round pictures at their places, drawn in light."""

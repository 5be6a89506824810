"""Sessions in a headset: choices by controllers, searches with a free head, logs of frames and head."""

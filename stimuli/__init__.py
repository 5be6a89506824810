"""What is shown: video sources, built-in sequences, luminance ramps."""

"""What becomes of a video: its loss curves, its brightness track, and what the online controller did."""

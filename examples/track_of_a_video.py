"""A brightness track for a video: `python examples/track_of_a_video.py film.mp4 film-track`."""

import sys

import evenlight

video, folder = sys.argv[1:3]
track = evenlight.optimize(video, budget=0.5, display="varjo-xr3", rate_limit="surace2025")
print(track)
print(f"mean power {track.power().mean():.3f} W, loss differs by {track.objective:.4f} between two frames")
print(f"constant dimming by {track.baseline:.2f}: {track.objective_baseline:.4f}")
print(track.to_frame().head())
track.save(folder)

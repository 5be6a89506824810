"""A backlight that follows a film's track while the film plays in a player of the user's own: mpv."""

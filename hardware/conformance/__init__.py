"""What every driver promises, tried on any of them: `evenlight measure conform`."""

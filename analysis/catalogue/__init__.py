"""Many or long videos, on a cluster: what `evenlight catalogue` does."""

"""The player page: a video beside its dimmed versions, in any browser."""

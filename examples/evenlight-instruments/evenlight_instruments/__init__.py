"""Drivers of three instruments that do not exist: an example to copy (docs/drivers.md of Evenlight)."""

"""Tests, intervals and models that more than one experiment needs."""

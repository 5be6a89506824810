"""Checking files, data sets and folders of results (`evenlight validate`)."""

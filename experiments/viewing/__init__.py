"""The viewing experiments (Section 4): rating, comparison and search, each with its observer."""

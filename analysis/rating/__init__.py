"""Detail ratings: means, exact tests, models, what order does."""

"""Search times: found and not found, models, what light does."""

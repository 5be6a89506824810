"""One hierarchical model from all participants' answers to the rate limit."""

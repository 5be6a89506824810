"""Which curve serves as the rate limit: the candidates compared, also by what they do to a clip."""

"""Textures that are computed: a function of a generator and a size gives linear albedo."""

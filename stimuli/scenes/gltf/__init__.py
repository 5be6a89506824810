"""Scenes as glTF files: a lab's own come in, the built-in ones go out."""

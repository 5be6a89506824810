"""What is built with the engine: places, the things in them, their surfaces, and walks through them."""

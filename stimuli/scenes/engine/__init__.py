"""What builds, lights and draws any scene; it knows none of them."""

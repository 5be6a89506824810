"""The light on the surfaces of a scene, baked once and drawn from then on."""

"""The measured power of a played video: clocks brought together, energies of frames, versions compared."""

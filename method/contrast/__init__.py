"""From pixel values to contrast loss: the paper's chain in its order, and its fast forms."""

"""What the paper's published numbers themselves support."""

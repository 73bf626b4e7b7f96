"""The elbow bench, reference 1."""

"""The bench: references, peers and error against run time."""

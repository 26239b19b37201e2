"""Filters between a noisy estimate and the frame."""

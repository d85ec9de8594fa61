"""Tactile images: from the bytes of a board to the features of a frame."""

"""Readers of rule bases and trees, one module per format."""

"""Whether all representations of a model agree, and how stable it is."""

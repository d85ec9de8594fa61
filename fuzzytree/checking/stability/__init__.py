"""Is a model, and learning, numerically stable: criteria N1 to N10, by module."""

"""What a model means: evaluation, programs, conversion and simplification."""

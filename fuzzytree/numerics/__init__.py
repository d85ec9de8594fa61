"""What rounding can do to a model, derived and not tuned."""

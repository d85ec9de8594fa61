"""What executes a model on frames."""

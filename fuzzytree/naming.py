"""Names that a target accepts, and the way back to the names of the model."""

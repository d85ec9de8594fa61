"""Requirements: what a model must do, in sentences that are proved or refuted."""

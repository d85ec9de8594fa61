"""Writers of models that take frames."""

"""The meaning of a fuzzy system, written to be believed and not to be fast."""

"""Learn fuzzy decision trees, read them as rules, run them anywhere, and prove it."""

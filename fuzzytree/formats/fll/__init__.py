"""fuzzylite's FLL files."""

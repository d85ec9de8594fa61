"""Fuzzy Markup Language (IEEE 1855)."""

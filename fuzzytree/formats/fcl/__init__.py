"""Fuzzy Control Language (IEC 61131-7)."""

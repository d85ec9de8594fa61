"""Audits of rule bases: findings, the engine that proves them, diffs, re-checks."""

"""Rule bases as systems with numeric outputs, the way back, and points for curves."""

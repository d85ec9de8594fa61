"""Rule bases as systems with numeric outputs, and the way back."""

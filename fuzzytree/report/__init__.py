"""Results as text: they show, they compute nothing."""

"""Boards and presses of our own: what a sensor would read, and what a line would do."""

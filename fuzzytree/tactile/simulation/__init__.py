"""Presses of our own: what a sensor would read when an object lies on it."""

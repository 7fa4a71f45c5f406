"""Repeats recorded decisions."""

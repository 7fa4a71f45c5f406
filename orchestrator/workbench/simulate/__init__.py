"""Simulates a policy over hours."""

"""Charging-station orchestrator: drives industrial chargers from batteries' own readings, and stops safely."""

__version__ = "0.1.0"

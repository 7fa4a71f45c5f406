"""Charging-station orchestrator: stands between batteries and industrial chargers, and stops safely."""

__version__ = "0.1.0"

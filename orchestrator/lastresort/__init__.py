"""Stops chargers when all else has failed: the guardian and `estop`. Standard library and one frame."""

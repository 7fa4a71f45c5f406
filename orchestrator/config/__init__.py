"""Reads station, policy, object-map and scenario files into frozen objects; every error has file, line and column."""

"""Reads strict YAML into frozen dataclasses, with file, line and column for each mistake."""

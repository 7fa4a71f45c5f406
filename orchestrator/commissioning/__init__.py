"""Commissioning: query a bay's devices and find its object map before the first charge."""

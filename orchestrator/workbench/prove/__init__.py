"""Proves what a policy can never do, and warns of what is probably unintended."""

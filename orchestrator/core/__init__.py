"""The decisions, and nothing else: pure functions of their arguments."""

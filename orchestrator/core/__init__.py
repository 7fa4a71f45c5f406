"""The decisions, and nothing else: pure functions of their arguments. No clock, no log, no thread, no file."""

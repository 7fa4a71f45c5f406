"""Sentences from causes: the only place where any are made."""

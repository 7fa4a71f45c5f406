"""Sentences from causes: the only place where any is made."""

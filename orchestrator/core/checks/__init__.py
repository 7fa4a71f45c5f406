"""The predicates of the fault table: each looks at the facts and returns what it saw, or None.

They never debounce, never latch and never decide what follows: the table does. The text is the evidence that an
operator reads, with the value, the limit and where the limit stands.
"""

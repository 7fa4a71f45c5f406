"""The predicates of the fault table: each looks at the facts and returns what it saw, or None.

They never debounce, latch or decide what follows: the table does. The cause they return is the evidence that an
operator reads, with the value, the limit and the place of the limit.
"""

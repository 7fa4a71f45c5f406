"""Tools for those who write policies and those who check the core: they run the real `step()`, never a copy of it."""

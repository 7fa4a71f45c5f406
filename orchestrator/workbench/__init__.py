"""Tools for writing policies and for checking the core: they run the real `decide()`, never a copy of it."""

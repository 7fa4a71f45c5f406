"""Station and policy files into frozen objects, every error with its file, line and column."""

"""Pure decision functions of their arguments: no clock, no log, no thread, no file."""

"""One charger or one battery each: poll, command, read back, with deadlines; they turn frames into readings."""

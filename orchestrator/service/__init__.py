"""The running process: threads, clock, socket, journal."""

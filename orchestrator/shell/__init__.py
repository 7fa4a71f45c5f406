"""The command line towards the shell around it: examples, completion, manual page."""

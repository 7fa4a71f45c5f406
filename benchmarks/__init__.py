"""Measures the service beside floors and a naive controller: `make bench`. Numbers to read, not a test."""

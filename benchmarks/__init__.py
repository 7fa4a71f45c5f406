"""Measures the service against floors and a naive controller: `make bench`. Numbers to read, not a test."""

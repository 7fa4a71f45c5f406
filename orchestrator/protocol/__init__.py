"""The devices' languages, without I/O: bytes in, records out, and back."""

"""The devices' protocols, without I/O: bytes to records and back."""

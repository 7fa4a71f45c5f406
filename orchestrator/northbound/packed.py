"""A gzip stream in pieces that are packed once for many readers.

Each piece is deflate blocks that refer to nothing before them and end on a byte, so they can follow one another in any
order behind one header. A live stream has no end, and so no checksum.
"""

import zlib

#: The header of a gzip file without a name.
HEAD = b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\xff"
#: Raw deflate, without a header of its own.
RAW = -15
#: The status of many bays shrinks to a tenth already with this.
LEVEL = 4


def piece(text: str) -> bytes:
    """These characters, packed."""
    packer = zlib.compressobj(LEVEL, wbits=RAW)
    return packer.compress(text.encode()) + packer.flush(zlib.Z_SYNC_FLUSH)

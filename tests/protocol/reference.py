"""A second decoder, written from the document alone, slow and obvious: the product's must agree with it."""


def good_frame_at(stream: bytes, at: int) -> int:
    """The size of the good frame starting at `at`, or 0."""
    if stream[at : at + 3] != b"\xaf\xfa\x90" or at + 4 > len(stream):
        return 0
    data_bytes = stream[at + 3] - 3
    size = 2 + 1 + 1 + 1 + 1 + data_bytes + 1 + 2
    frame = stream[at : at + size]
    if not 0 <= data_bytes <= 32 or len(frame) < size or frame[-2:] != b"\xaf\xa0":
        return 0
    return size if sum(frame[2:-3]) % 256 == frame[-3] else 0


def frames_in(stream: bytes) -> list[bytes]:
    """Every good frame; where none starts, the search continues at the next byte."""
    found, at = [], 0
    while at < len(stream):
        size = good_frame_at(stream, at)
        if size:
            found.append(stream[at : at + size])
        at += size or 1
    return found

"""Passwords as scrypt hashes: memory-hard, and slow enough that guessing them takes long."""

import hmac
import secrets
from functools import cache
from hashlib import scrypt

from orchestrator.config.northbound_rules import PASSWORD

#: 16 MiB and some 50 ms for each try.
N, R, P = 2**14, 8, 1
#: What any hash of a users file may cost: it is a file of ours.
MOST_BYTES = 64 * 1024 * 1024
#: The shortest password that is taken, and the longest that is hashed.
SHORTEST, LONGEST = 8, 256


def hashed(password: str, salt: bytes | None = None) -> str:
    """As it stands in a users file."""
    salt = secrets.token_bytes(16) if salt is None else salt
    return f"scrypt:{N}:{R}:{P}:{salt.hex()}:{_scrypt(password, salt, N, R, P).hex()}"


def matches(password: str, told: str) -> bool:
    """Whether this is the password; as slow if it is not."""
    match = PASSWORD.fullmatch(told)
    if match is None or len(password) > LONGEST:
        return False
    n, r, p = (int(match[number]) for number in (1, 2, 3))
    try:
        found = _scrypt(password, bytes.fromhex(match[4]), n, r, p)
    except ValueError:  # figures that scrypt does not take
        return False
    return hmac.compare_digest(found, bytes.fromhex(match[5]))


@cache
def nobodys() -> str:
    """Compared with where there is no such user: an answer takes as long."""
    return hashed(secrets.token_hex())


def _scrypt(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return scrypt(password.encode("utf-8", "surrogatepass"), salt=salt, n=n, r=r, p=p, dklen=32, maxmem=MOST_BYTES)

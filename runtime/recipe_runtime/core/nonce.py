"""The only source of entropy: the nonce of the verifier and the key of journals. Neither affects a dataset's bytes."""

import secrets


def fresh_nonce() -> int:
    """Return a number that the author of a dataset could not have predicted."""
    return secrets.randbits(53)


def fresh_key() -> bytes:
    """A secret that seals what only this host may have written."""
    return secrets.token_bytes(32)

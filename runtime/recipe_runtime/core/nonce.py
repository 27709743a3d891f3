"""The only source of entropy: the verifier's nonce. It never affects the bytes of a dataset."""

import secrets


def fresh_nonce() -> int:
    """Return a number that the author of a dataset could not have predicted."""
    return secrets.randbits(53)

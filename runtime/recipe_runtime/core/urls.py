"""URLs as they may be shown: without passwords, tokens and signatures.

A URL may hold a secret as the password before `@`, as a long user name (a token), in its query (`?sig=...`,
`?X-Amz-Signature=...`, `?token=...`), in parameters of its path (`;sig=...`), or in its fragment. The colon before a
password may be escaped (`%3A`). Passwords of S3 URLs contain unescaped `/` and `@`, so everything up to the last `@` is
taken for the password. A path library may have merged slashes, so one slash begins a URL as two do. Where a part may or
may not be a secret it is masked.
"""

from __future__ import annotations

import re
from functools import partial
from urllib.parse import unquote

MASK = "***"

_URL = re.compile(r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]{0,40}):(?P<slashes>/+)(?P<rest>\S*)")
_COLON = re.compile(r":|%3A", re.IGNORECASE)
_PARAMETERS = re.compile(
    r";[^;?#]*?=(?:(?!::[A-Za-z][A-Za-z0-9+.-]*:/).)*"
)  # `;sig=...`, up to a URL that is chained to this one
_ALL_PARAMETERS = re.compile(r";[^;?#]*?=.*")  # with what looks like a chained URL, which may be a part of a secret
_DELIMITERS = re.compile(r"[]/?#@:[]")
_PATHS = {"file", "local"}  # URLs of these are paths alone
_END = "'\"`:;,.)]}>"  # punctuation of the sentence around a URL
_PORTS = {"http", "https", "ftp", "ftps", "sftp", "ssh", "smb", "hdfs", "webhdfs", "memory"}  # `host:21`, not `key:21`
_TOKEN_LENGTH = 20  # a user name so long is a token
_MIN_SECRET = 4  # shorter texts are masked within their URL only
_MAX_CHAINED = 8  # URLs in each other; what a deeper one holds is masked


def without_secrets(text: str, *urls: str) -> str:
    """Text with the secrets of all URLs in it masked: `ftp://user:***@host/x?***` for `ftp://user:pw@host/x?sig=1`.

    Args:
        text: a URL, or text with some, such as a library's error.
        urls: further URLs, whose secrets are masked wherever they occur in the text, with or without their URL.
    """
    found = {secret for url in urls for secret in _secrets(url)}
    for secret in sorted(found, key=len, reverse=True):
        text = text.replace(secret, MASK)
    return _URL.sub(_masked, text)


def shown(url: str) -> str:
    """One whole URL, to be shown; its white space is part of it."""
    text = re.sub(r"\s", "%20", url)
    return _URL.sub(lambda match: _masked(match, whole=True), text)


def _masked(match: re.Match[str], whole: bool = False, depth: int = 0) -> str:
    """A URL, matched by `_URL`, without its secrets; unless it is `whole`, punctuation at its end is no part of it.

    `depth` is the number of URLs that it is chained to.
    """
    if depth > _MAX_CHAINED:
        return MASK
    scheme, rest = match["scheme"], match["rest"]
    own = rest if whole else rest.rstrip(_END)
    rest, tail = own, rest[len(own) :]
    user, password, place = _split(scheme, rest, match["slashes"])
    head = "" if place == rest else f"{user}:{MASK}@" if password is not None else f"{MASK}@"
    place, hash_, fragment = place.partition("#")
    place, mark, query = place.partition("?")
    inner = _URL.sub(partial(_masked, depth=depth + 1), _PARAMETERS.sub(f";{MASK}", place))
    query = f"?{MASK}" if query else mark
    return f"{scheme}:{match['slashes']}{head}{inner}{query}{f'#{MASK}' if fragment else hash_}{tail}"


def _split(scheme: str, rest: str, slashes: str) -> tuple[str, str | None, str]:
    """User, password and the rest of a URL after `://`. Without a secret there, the rest is all of it.

    Digits after an escaped colon, or where slashes were merged, are no port.
    """
    link = scheme.lower().rpartition("+")[2]
    if link in _PATHS:
        return "", None, rest
    first = rest.partition("/")[0]
    found = _COLON.search(first)
    user, colon, after = (first[: found.start()], found[0], first[found.end() :]) if found else (first, "", "")
    if colon and "@" not in user and "@" in rest[len(user) :]:
        plain = colon == ":" and slashes == "//"
        is_port = plain and "@" not in after and re.fullmatch(r"[0-9]{1,5}", after) and link in _PORTS
        if user and not is_port:
            password, _, place = rest[len(user) + len(colon) :].rpartition("@")
            return user, password, place
    name, at, _ = first.rpartition("@")
    if at and len(name) >= _TOKEN_LENGTH:
        return name, None, rest[len(name) + 1 :]
    return "", None, rest


def _secrets(url: str) -> set[str]:
    """The secrets of a URL, and of those chained in it, as written and decoded."""
    found: set[str] = set()
    for match in _URL.finditer(url):
        user, password, place = _split(match["scheme"], match["rest"], match["slashes"])
        place, _, fragment = place.partition("#")
        found_parameters = [*_PARAMETERS.findall(place), *_ALL_PARAMETERS.findall(place)]
        parameters = [text.partition("=") for found in found_parameters for text in found[1:].split(";")]
        values = [value for pair in place.partition("?")[2].split("&") for value in (pair.partition("=")[2], pair)]
        values += [text for name, _, value in parameters for text in (value, f"{name}={value}") if value]
        found |= {password or "", fragment, *values} | ({user} if password is None else set())
        for text in (password or "", unquote(password or "")):
            found |= set(_DELIMITERS.split(text))  # libraries quote a part of a URL, up to one of these
    found |= {unquote(secret) for secret in found}
    return {secret for secret in found if len(secret) >= _MIN_SECRET}

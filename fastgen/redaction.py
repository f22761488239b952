"""Removal of passwords from text that is printed."""

import re
from urllib.parse import unquote

_HIDDEN = "***"

_PASSWORD = re.compile(r"(?P<before>\b[a-zA-Z][\w+.-]*(?::/*|//)[^\s/:@]*:)(?P<secret>\S*)@")
_TOKEN = re.compile(r"(?P<before>\bhttps?://)(?P<secret>[^\s/:@]+)@")
_QUERY = re.compile(r"(?P<before>://[^\s?]*\?)(?P<secret>[^\s?=]*=\S*)")
"""Secrets in addresses: after user and colon, alone before @, and in a signed query.

A password may contain any character, so it reaches to the last @. Addresses may be mistyped, with
one slash or without a colon.
"""


def without_secrets(text: str, address: str = "") -> str:
    """Return `text` with *** in place of the secrets of addresses in it.

    Args:
        text: Words for people.
        address: An address whose password is hidden wherever it occurs in the text, also alone.
    """
    text = _PASSWORD.sub(rf"\g<before>{_HIDDEN}@", text)
    text = _TOKEN.sub(rf"\g<before>{_HIDDEN}@", text)
    text = _QUERY.sub(rf"\g<before>{_HIDDEN}", text)
    for pattern in (_PASSWORD, _TOKEN, _QUERY):
        for found in pattern.finditer(address):
            for secret in filter(None, {found["secret"], unquote(found["secret"])}):
                text = text.replace(secret, _HIDDEN)
    return text

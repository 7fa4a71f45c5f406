"""What a request says of the person behind it: for whom root asks, and why. The rest the kernel tells the service."""

import os
from collections.abc import Mapping

#: The longest reason.
MOST_BECAUSE = 200


def signed(request: Mapping[str, object], because: str = "") -> dict[str, object]:
    """The request with the reason, and with the person who became root by sudo."""
    sudo_user = os.environ.get("SUDO_USER", "") if os.geteuid() == 0 else ""
    told = {"sudo_user": one_line(sudo_user), "because": one_line(because)}
    return {**request, **{name: text for name, text in told.items() if text}}


def one_line(text: str, most: int = MOST_BECAUSE) -> str:
    """The text as one printable line of bounded length: a stop is never refused for what is said beside it."""
    printable = "".join(one if one.isprintable() else " " for one in text[: 4 * most])
    line = " ".join(printable.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"

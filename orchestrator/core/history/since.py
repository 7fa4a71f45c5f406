"""Since when a condition has held."""


def since(holds: bool, since_s: float | None, now_s: float) -> float | None:  # noqa: FBT001 - the condition itself
    """Since when it has held without a break; None while it does not."""
    if not holds:
        return None
    return now_s if since_s is None else since_s

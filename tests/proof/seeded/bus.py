"""Seeds about others on the CAN bus."""

from tests.proof.seeded.seed import DEVICES, LINK, Seed, part, scene

BUS: tuple[Seed, ...] = (
    scene(
        "another master's answer is a second node",
        "bus",
        "answers to another master count as a second BMU's",
        ("on the bus, reads all", "on the bus, master"),
        (f"{DEVICES}whose_answer.py", "    if not others.active:\n", "    if True:\n"),
    ),
    part(
        "a refusal to another master is ours",
        "bus",
        "an abort answering another master's write trips the bay",
        ("tests/devices/test_battery_others.py",),
        (
            f"{DEVICES}whose_answer.py",
            "    if isinstance(reply, SdoValue):\n        client.asked_s",
            "    if True:\n        client.asked_s",
        ),
    ),
    scene(
        "CAN FD frames are CANopen's",
        "bus",
        "a CAN FD frame with a BMU's id counts as its answer",
        ("on the bus, fd",),
        (f"{LINK}can_frames.py", " or taken.is_fd or", " or"),
    ),
    scene(
        "a heartbeat that somebody has set stays so",
        "bus",
        "a heartbeat period set by another master stays",
        ("on the bus, heartbeat",),
        (
            f"{DEVICES}bmu_setup.py",
            "        if period_ms == round(self._heartbeat_s * 1000):\n            return None\n",
            "        if True:\n            return None\n",
        ),
    ),
    part(
        "a filter of the station's own is refused",
        "bus",
        "can_filters in the station file are refused, whatever they let through",
        ("tests/config",),
        ("orchestrator/config/can_rules.py", "        if passed is None:\n", "        if True:\n"),
    ),
    part(
        "the kernel filters nothing",
        "bus",
        "every frame of a shared bus reaches the service",
        ("tests/link/test_can_filter.py",),
        (
            f"{LINK}can.py",
            "            if self._filtered and self._callbacks and",
            "            if False and self._callbacks and",
        ),
    ),
)

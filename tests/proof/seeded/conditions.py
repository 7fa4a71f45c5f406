"""Seeds about conditions that come and go, and their timers."""

from tests.proof.seeded.seed import CORE, DEVICES, SERVICE, Seed, part, scene

CONDITIONS: tuple[Seed, ...] = (
    scene(
        "a debounce begins anew",
        "comes and goes",
        "one clean sample resets the time a condition has held",
        ("apart for most of the time",),
        (f"{CORE}drain.py", "max(0.0, seconds - DRAIN * passed_s)", "0.0"),
    ),
    scene(
        "a limit that goes back is not seen",
        "comes and goes",
        "neither a setting that reverts nor a current above the step is a fault",
        ("limit goes back",),
        (f"{CORE}checks/obedience.py", "    if step is None or len(recent) < MAX_REVERTS:\n", "    if True:\n"),
        (f"{CORE}checks/obedience.py", "    if f.amps <= limit_a:\n", "    if True:\n"),
    ),
    part(
        "returns of a setting are not counted",
        "comes and goes",
        "a charger that confirms each step and then drops it is healthy",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}checks/obedience.py", "    if step is None or len(recent) < MAX_REVERTS:\n", "    if True:\n"),
    ),
    scene(
        "a loose plug never latches",
        "comes and goes",
        "a battery removed and put back is charged again each time",
        ("loose plug",),
        (f"{CORE}history/battery.py", "f.now_s - known.left_s < LOOSE_PLUG_S and not _is_another(f)", "False"),
    ),
    scene(
        "another kind of pack is charged",
        "battery",
        "volts per cell, SOC and chemistry are not compared",
        ("a pack of 36 V",),
        (
            f"{CORE}witnesses/pack.py",
            "    if f.pack_v is None or f.soc is None:\n        return None\n",
            "    return None\n",
        ),
    ),
    scene(
        "another kind of pack is deeply discharged",
        "battery",
        "a 24 V pack is reported as too deeply discharged",
        ("a pack of 24 V",),
        (f"{CORE}checks/battery.py", " or another_pack(f) is not None:", ":"),
    ),
    scene(
        "a pack may collapse",
        "battery",
        "a voltage drop in mid-charge is not a fault",
        ("a pack that collapses",),
        (
            f"{CORE}witnesses/pack.py",
            "    if f.memory.state is not State.CHARGING or f.pack_v is None",
            "    if True or f.pack_v is None",
        ),
    ),
    scene(
        "a BMU may stand still",
        "battery",
        "a BMU with frozen values is believed",
        ("a BMU that is frozen",),
        (
            f"{CORE}witnesses/measured.py",
            "    if frozen is None or session is None or f.volts is None or",
            "    if True or session is None or",
        ),
    ),
    scene(
        "the first answer counts",
        "battery",
        "the first of two different answers to one request is believed",
        ("a temperature that is forged",),
        (f"{DEVICES}two_answers.py", "        if not apart:\n", "        if True:\n"),
    ),
    part(
        "nobody proves the pairing",
        "battery",
        "the first amperes need not show on the bay's own BMU",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}witnesses/paired.py", "    if not f.energised or known.proved or", "    if True or known.proved or"),
    ),
    scene(
        "charges begin together",
        "battery",
        "the charges of a station do not start one after another",
        ("nothing happens",),
        (f"{SERVICE}starts.py", "        if not self._stagger_s:\n", "        if True:\n"),
    ),
    scene(
        "hot is not seen",
        "battery",
        "no current flows above 45 °C, the limit of pack and policy: now 50 °C",
        ("hot",),
        (f"{CORE}checks/battery.py", "    high = f.rules.temperature_c.high\n    again", "    high = 50.0\n    again"),
    ),
)

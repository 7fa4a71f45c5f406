"""Seeds about restarts: what a new life of the gateway must know."""

from tests.proof.seeded.seed import CORE, Seed, part, scene

RESTARTS: tuple[Seed, ...] = (
    scene(
        "what flowed before a kill is forgotten",
        "restart",
        "ampere-hours charged after the last write of the counters do not count",
        ("ampere-hours over kills",),
        (
            f"{CORE}persisted.py",
            "min(seconds if unseen_s is None else unseen_s, COUNTERS_S) if self.running else 0.0",
            "0.0",
        ),
    ),
    part(
        "a charger that ran at the start was never stopped",
        "restart",
        "a charger running at the start and again after each stop is reported as out of control one return late",
        ("tests/core/test_safestop.py::test_a_charger_that_ran_at_the_start_has_been_stopped_once_already",),
        (
            f"{CORE}safestop.py",
            '        if stop.stopping_s is None and "found_running" in f.raised:',
            "        if False:",
        ),
    ),
    part(
        "a restart believes a charger out of control",
        "restart",
        "a restart ends the standby that must last, and lowers the alarm",
        ("tests/core/test_persisted.py",),
        (f"{CORE}persisted.py", "if memory.state is not State.UNCONTROLLABLE:", "if memory:"),
    ),
    scene(
        "the open charge is not kept",
        "restart",
        "a restart resets the ampere-hours and seconds of a charge",
        ("ampere-hours over restarts",),
        (
            f"{CORE}persisted.py",
            "            session=replace(session, started_s=now_s - session.started_s) if session is not "
            "None else None,\n            full_pct=memory.battery.full_pct,",
            "            full_pct=memory.battery.full_pct,",
        ),
    ),
    scene(
        "a lost BMU ends the charge",
        "restart",
        "a temporary silence of its BMU resets the limits of a charge",
        ("ampere-hours over silences",),
        (
            f"{CORE}states.py",
            "K.UNSEEN, K.RESTING, K.SETTLED, K.QUIET})",
            "K.UNSEEN, K.RESTING, K.SETTLED, K.QUIET, K.SESSION_ENDS})",
        ),
        (
            f"{CORE}states.py",
            "    S.SUSPENDED: frozenset({",
            "    S.SUSPENDED: frozenset({K.SESSION_ENDS, ",
        ),
    ),
    scene(
        "a precharge begins anew",
        "restart",
        "a restart resets the time within which a precharged pack must rise",
        ("precharge over restarts",),
        (
            f"{CORE}persisted.py",
            "            session=replace(session, started_s=now_s - session.started_s) if session is not "
            "None else None,\n            full_pct=self.full_pct,",
            "            session=replace(session, started_s=now_s - session.started_s, rise_s=0.0, rise_v=None) "
            "if session is "
            "not None else None,\n            full_pct=self.full_pct,",
        ),
    ),
    part(
        "strikes are not kept",
        "restart",
        "a fault recurring after each restart never latches",
        ("tests/core/test_persisted.py",),
        (
            f"{CORE}persisted.py",
            "                strikes=tuple(now_s - t_s for t_s in fault.strikes),\n",
            "                strikes=(),\n",
        ),
    ),
    part(
        "resets are not kept",
        "restart",
        "a restart allows three more resets",
        ("tests/core/test_persisted.py",),
        (
            f"{CORE}persisted.py",
            "            resets=tuple((now_s - t_s, name) for t_s, name in memory.operator.resets),\n",
            "",
        ),
    ),
)

"""Seeds about messages to people."""

from tests.proof.seeded.seed import CORE, LASTRESORT, SERVICE, Seed, hostile, part, scene

WORDS: tuple[Seed, ...] = (
    scene(
        "out of control is told with advice about cables",
        "words",
        "the message for UNCONTROLLABLE does not begin with what to do",
        ("says standby", "cut off, then killed"),
        (
            f"{CORE}outofcontrol.py",
            '    id_ = "uncontrollable" if _heard(f) and f.runs else "uncontrollable_unproved"\n',
            "    return _witnesses(f)\n",
        ),
    ),
    scene(
        "a restart ends the alarm",
        "words",
        "a charger that ran when the service died and is not heard raises no alarm",
        ("cut off and not heard, killed at once",),
        (f"{CORE}alarm.py", "    unknown = memory.stop.unverified and", "    unknown = False and"),
        (
            f"{CORE}safestop.py",
            "        return memory.stop.unverified and f.state_s >= LOST_S\n",
            "        return False\n",
        ),
        (
            f"{CORE}next_transition.py",
            "if state is State.STARTING and not memory.stop.unverified and not f.charger.online",
            "if state is State.STARTING and not f.charger.online",
        ),
    ),
    hostile(
        "a stop that is not verified is a success",
        "words",
        "orchestrator stop exits with 0 whatever the result of the stop",
        ("tests/whole/test_operator.py::test_a_stop_that_is_not_obeyed_begins_with_what_to_do",),
        (
            f"{SERVICE}request_verb.py",
            "        unverified = _wait_for_standby(path, looked_at, language, every=arguments.all)\n",
            "        unverified = {}\n",
        ),
    ),
    hostile(
        "estop finds no station by itself",
        "words",
        "estop without arguments only knows the file in this directory",
        ("tests/guardian/test_emergency.py::test_else_those_of_the_services_that_run",),
        (
            f"{LASTRESORT}inhand.py",
            "    for place in PLACES:\n        yield _existing([place])\n    yield _existing(",
            "    yield _existing([PLACES[0]])\n    return\n    yield _existing(",
        ),
    ),
    part(
        "old values are not marked",
        "words",
        "a current last received long ago is shown as current",
        ("tests/service/test_status.py", "tests/service/test_show.py"),
        (f"{SERVICE}status.py", '"old": age_s is not None and age_s > CHARGER_STALE_S,', '"old": False,'),
    ),
    hostile(
        "a success reads like a failure",
        "words",
        "an estop without a service ends with a complaint",
        ("tests/guardian/test_estop_alone.py::test_ports_without_a_service",),
        (f"{LASTRESORT}running_service.py", "        if not _listens(self._named):\n", "        if False:\n"),
    ),
)

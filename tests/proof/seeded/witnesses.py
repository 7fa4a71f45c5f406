"""Seeds about the two witnesses: what charger and BMU reveal about each other."""

from tests.proof.seeded.seed import CORE, LASTRESORT, SERVICE, Seed, hostile, part, scene

WITNESSES: tuple[Seed, ...] = (
    scene(
        "a stop while the service ends is lost",
        "reasons",
        "the reason of the end replaces an operator's stop in the same second",
        ("stopped while it ends",),
        (
            f"{SERVICE}bay.py",
            "        persisted = self._timer.kept(self.identified.kept(Persisted.of(memory, now_s)))\n",
            "        persisted = self._timer.kept(self.identified.kept(Persisted.of(memory, now_s)))\n"
            "        if self._ending:\n"
            '            persisted = replace(persisted, hold="")\n',
        ),
    ),
    scene(
        "the end of the service is a hold",
        "reasons",
        "a bay waits for a person after a clean restart",
        ("restarted in order",),
        (
            f"{SERVICE}bay.py",
            "        self._ending = why\n",
            "        self._ending = why\n        if self._memory is not None:\n"
            '            hold = self._memory.operator.hold or Cause.of("service_ends", why=why)\n'
            "            self._memory = with_values(self._memory, hold=hold)\n",
        ),
        (
            f"{SERVICE}bay.py",
            "from orchestrator.core.memory import Memory\n",
            "from orchestrator.core.memory import Memory, with_values\n",
        ),
    ),
    part(
        "one sample verifies a stop",
        "witness",
        "a single reply showing standby proves it",
        ("tests/core/test_witnesses.py",),
        (f"{CORE}witnesses/standby.py", "len(known.proof) < 2", "len(known.proof) < 1"),
    ),
    scene(
        "the charger alone verifies a stop",
        "witness",
        "the current seen by the BMU does not count",
        ("says standby",),
        (f"{CORE}witnesses/standby.py", "return f.pack_a is not None and f.pack_a > CHARGING_A", "return False"),
    ),
    part(
        "out of control is left at once",
        "witness",
        "UNCONTROLLABLE ends at the first standby, not at a lasting one",
        ("tests/core/test_witnesses.py",),
        (
            f"{CORE}safestop.py",
            "proved_to_last(f) if f.memory.state is State.UNCONTROLLABLE else f.stopped",
            "f.stopped",
        ),
    ),
    scene(
        "returns are not counted",
        "witness",
        "a charger that runs again within ten seconds counts as new each time",
        ("runs again",),
        (f"{CORE}safestop.py", "        runs_again = (f.runs", "        runs_again = False and (f.runs"),
    ),
    scene(
        "mode 5 alone is full",
        "witness",
        "a charger stopped by other means counts as full",
        ("stopped by other means",),
        (f"{CORE}finish.py", "    pack, trail = f.rules", "    return True\n    pack, trail = f.rules"),
    ),
    hostile(
        "estop believes one answer",
        "witness",
        "for estop, one answer in two showing standby is proof",
        ("tests/guardian/test_laststop.py::test_one_answer_in_two_is_no_proof",),
        (f"{LASTRESORT}lastline.py", "PROOFS = 2\n", "PROOFS = 1\n"),
    ),
    hostile(
        "estop does not ask the BMU",
        "witness",
        "estop believes the service's charger, whatever the BMU sees",
        ("tests/guardian/test_emergency.py::test_both_witnesses_have_to_agree",),
        (
            f"{LASTRESORT}running_service.py",
            ' if battery["online"] and bmu_a > BMU_STANDBY_A else ""',
            ' if False else ""',
        ),
    ),
)

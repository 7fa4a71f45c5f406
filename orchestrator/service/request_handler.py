"""Handles requests from the control socket, in its thread: builds the status, or passes requests to the bays."""

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from orchestrator.errors import RequestError
from orchestrator.model import Cause, Request
from orchestrator.model.cause import plain
from orchestrator.model.identity import LONGEST_ID, is_id
from orchestrator.service.asked import Asked
from orchestrator.service.asker import Asker, user_name
from orchestrator.service.bay import BayRunner
from orchestrator.service.chosen import unknown
from orchestrator.service.journal import Journal
from orchestrator.service.reception import Answer, Later, refused
from orchestrator.service.reload import Reading, Reload
from orchestrator.service.request_log import RequestLog
from orchestrator.service.station_status import StationStatus
from orchestrator.service.store import KEPT_WITHIN_S, Store
from orchestrator.service.strays import Strays
from orchestrator.service.terms import START_WITH, Terms
from orchestrator.text.catalogue import say

#: The next decision handles a request; the answer comes when it is on disk, or after 2 s. Later means a hung loop.
ANSWER_S = 3.0
#: The verbs that are no requests to the core.
RELOAD, IDENTIFY = "reload", "identify"
#: How long rereading the files may take, and how long a bay at rest may take to adopt its policy.
READ_S, ADOPT_S = 8.0, 1.5
#: An answer names no more unknown bays: its length is bounded.
MOST_UNKNOWN = 20


class RequestHandler:
    """Answers for a station. `wake` makes the control loop decide the bay with this number."""

    def __init__(
        self,
        shown: StationStatus,
        bays: Sequence[BayRunner],
        journal: Journal,
        store: Store,
        strays: Strays,
        reload: Reload,
        clock: Callable[[], float],
        wall: Callable[[], float],
        wake: Callable[[int], None],
    ) -> None:
        self._shown, self._bays, self._language = shown, bays, shown.language
        self._store, self._strays, self._reload = store, strays, reload
        self._clock, self._wall, self._wake = clock, wall, wake
        self._log = RequestLog(journal, clock, self._language)
        user_name(os.getuid())  # the only one who is let in, besides root

    def answer(self, request: Mapping[str, object]) -> Answer | Later:
        """Whatever was asked; RequestError where it cannot be understood or done."""
        verb = request.get("verb")
        if verb == "status":
            name = request.get("bay")
            bays = self._bays if name is None else [self._named(name)]
            return self._shown.document(bays, closely=name is not None)
        if verb == RELOAD:
            return self._reread(Asker.of(request, self._wall()))
        if isinstance(verb, str) and verb in {*Request, START_WITH}:
            names, port, asker = request.get("bays"), request.get("port"), Asker.of(request, self._wall())
            if verb == Request.RESET and isinstance(port, str):
                return self._drop(port, asker)
            terms, wanted = Terms.of(request, self._wall()), Request.START if verb == START_WITH else Request(verb)
            bays, others = (self._bays, {}) if names is None else self._meant(_names(names), wanted)
            spares = wanted is Request.START and request.get("spares") is True
            make = partial(Asked, wanted, asker, spares, terms.target_pct, terms.start_unix_s)
            return terms.told(self._ask(bays, make, others, terms.fields), self._wall, self._language)
        if verb == IDENTIFY:
            return self._identify(request.get("bays"), request.get("battery"), Asker.of(request, self._wall()))
        raise RequestError(
            Cause.of(
                "verb_unknown", verb=f"{verb!r:.80}", verbs=("status", "watch", RELOAD, *map(str, Request), IDENTIFY)
            )
        )

    def _identify(self, names: object, battery: object, asker: Asker) -> Later:
        """Name the battery in one bay; answered with its identity once that is on disk."""
        if not isinstance(battery, str) or not is_id(battery):
            raise RequestError(Cause.of("battery_id_wrong", battery=f"{battery!r:.80}", longest=LONGEST_ID))
        bay = self._named(_names(names)[0] if names else None, IDENTIFY)
        self._store.refuse_not_persisted(self._clock())
        named = bay.identified.name(battery)
        self._wake(self._bays.index(bay))
        end_s = self._clock() + ANSWER_S

        def results() -> Answer | None:
            if named.identity is not None and self._store.persisted_revision >= named.revision:
                told = named.identity.cause
                return {
                    **self._results({bay.name: None}, IDENTIFY, asker),
                    "identity": {**plain(told), "text": say(told, self._language)},
                }
            if named.refusal is None and self._clock() < end_s:
                return None
            late = self._store.not_persisted(self._clock()) or Cause("no_answer")
            return self._results({bay.name: named.refusal or late}, IDENTIFY, asker)

        return results

    def refused(self, request: Mapping[str, object], why: Cause) -> None:
        """Write down a request that reaches no bay."""
        verb, names = request.get("verb"), request.get("bays")
        if verb != "status":
            bays = [f"{name!s:.80}" for name in names[:MOST_UNKNOWN]] if isinstance(names, list) else None
            self._log.write("", f"{verb!s:.80}", Asker.of(request, self._wall()), why, bays=bays)

    def _reread(self, asker: Asker) -> Later:
        """Read the files again; answered once the bays at rest have adopted their policies."""
        reading, end_s = self._reload.ask(), self._clock() + READ_S
        settled_s: float | None = None

        def results() -> Answer | None:
            nonlocal settled_s
            now_s = self._clock()
            if not reading.done and now_s < end_s:
                return None
            refusal = reading.refusal if reading.done else Cause.of("reload_slow", limit_s=READ_S)
            if refusal is not None:
                self._log.write("", RELOAD, asker, refusal)
                return refused(refusal, self._language)
            settled_s = settled_s or now_s + ADOPT_S
            if now_s < settled_s and any(bay.policy.waits and bay.verified for bay in self._bays):
                return None
            return self._reread_by_bay(reading, asker)

        return results

    def _reread_by_bay(self, reading: Reading, asker: Asker) -> Answer:
        """Each bay's answer: refused until a restart, or accepted, with what is in force and what waits."""
        adopted = {bay.name for bay in self._bays if not bay.policy.waits}
        told = {
            name: Cause("policy_adopted", cause.params) if cause.id == "policy_offered" and name in adopted else cause
            for name, cause in reading.answers.items()
        }
        refusals = {name: cause if cause.id == "needs_restart" else None for name, cause in told.items()}
        notes = {name: say(cause, self._language) for name, cause in told.items()}
        return {
            **self._results(refusals, RELOAD, asker, notes),
            "notes": notes,
            "note_causes": {name: plain(cause) for name, cause in told.items()},
        }

    def _drop(self, port: str, asker: Asker) -> Later:
        """Forget a charger without a bay; answered once that is on disk."""
        self._store.refuse_not_persisted(self._clock())
        what, revision = self._strays.drop(port)
        verb = Request.RESET
        end_s = self._clock() + KEPT_WITHIN_S

        def results() -> Answer | None:
            if self._store.persisted_revision >= revision:
                return self._results({what: None}, verb, asker)
            if self._clock() < end_s:
                return None
            problem = self._store.not_persisted(self._clock()) or Cause("not_taken")
            return self._results({what: Cause.of("dropped_not_persisted", problem=problem)}, verb, asker)

        return results

    def _named(self, name: object, verb: str = "") -> BayRunner:
        for bay in self._bays:
            if bay.name == name:
                return bay
        known = tuple(bay.name for bay in self._bays)
        cause = unknown([f"{name!s:.80}"], known)
        raise RequestError(cause.with_(then=Cause.of("done_nowhere", verb=verb)) if verb else cause)

    def _meant(self, names: list[object], verb: str) -> tuple[list[BayRunner], dict[str, Cause]]:
        """The bays with these names, each once, and what the others are told: a stop is not left undone for them."""
        known = [bay.name for bay in self._bays]
        wrong = [name for name in names if name not in known]
        if wrong and (verb != Request.STOP or len(wrong) == len(names)):
            self._named(wrong[0], verb)
        told = [f"{name!s:.80}" for name in wrong[:MOST_UNKNOWN]] + ["…"] * (len(wrong) > MOST_UNKNOWN)
        meant = dict.fromkeys(self._bays[known.index(name)] for name in names if name in known)
        return list(meant), {", ".join(told): unknown(told, known)} if told else {}

    def _ask(
        self,
        bays: Sequence[BayRunner],
        make: Callable[[], Asked],
        others: Mapping[str, Cause] | None = None,
        more: Mapping[str, object] | None = None,
    ) -> Later:
        """Pass a request to each bay; their answers come later, "" means yes, with those to `others`.

        `more` is for the record.
        """
        asked = {bay.name: make() for bay in bays}
        for bay in bays:
            bay.ask(asked[bay.name])
            self._wake(self._bays.index(bay))
        model = make()
        end_s = self._clock() + ANSWER_S
        late = Cause("no_answer")

        def results() -> Answer | None:
            if not all(one.done.is_set() for one in asked.values()) and self._clock() < end_s:
                return None
            answers = {name: one.answer if one.done.is_set() else late for name, one in asked.items()}
            return self._results({**answers, **(others or {})}, model.request, model.asker, more=more)

        return results

    def _results(
        self,
        answers: Mapping[str, Cause | None],
        verb: str,
        asker: Asker,
        notes: Mapping[str, str] | None = None,
        more: Mapping[str, object] | None = None,
    ) -> Answer:
        for name, answer in answers.items():
            note = {"note": notes[name]} if notes else {}
            self._log.write(name, str(verb), asker, answer, **note, **(more or {}))
        return {
            "language": self._language,
            "results": {name: say(answer, self._language) for name, answer in answers.items()},
            "causes": {name: plain(answer) for name, answer in answers.items() if answer is not None},
        }


def _names(value: object) -> list[object]:
    if not isinstance(value, list):
        raise RequestError(Cause("bays_no_list"))
    return value

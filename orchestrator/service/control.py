"""The control socket: accepts clients and their requests. One JSON object per line, in and out.

One thread serves all clients at once and waits for none: each has limits on time and bytes, and a slow client delays
only itself. Stops go first (`reception.py`). After each turn the thread rests, so that no number of clients takes more
than a fixed share of the CPU; the control loop never waits for a client.
"""

import errno
import selectors
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from time import sleep, thread_time

from orchestrator.errors import RequestError
from orchestrator.model import Cause
from orchestrator.service.client import Client, parse_request
from orchestrator.service.doorkeeper import Doorkeeper, group_id
from orchestrator.service.reception import WATCH, Handler, OnRefused, Reception, encode, refused
from orchestrator.service.socketfile import SocketName

#: The maximum number of clients served at once; one more displaces the longest idle one.
MAX_CLIENTS = 256
#: The maximum number accepted in one turn.
TURN_CLIENTS = 64
#: After each turn the thread rests for this multiple of the turn's CPU time, up to a limit.
REST, REST_S = 4.0, 0.05
#: How often to check the bays' answers, the clients' time limits, and the socket's name.
POLL_S, TICK_S, NAME_S = 0.002, 0.1, 2.0
#: A turn that takes longer than this hangs.
STALL_S = 30.0
#: accept()'s errors for a closed listener; after any other error it is worth trying again a little later.
CLOSED = (errno.EINVAL, errno.EBADF)
RETRY_S = 0.1


class ControlSocket:
    """Listens on a Unix socket and answers each request by `handler` (`Reception`)."""

    def __init__(
        self,
        path: Path,
        handler: Handler,
        clock: Callable[[], float],
        say: Callable[[Cause], None] = lambda _: None,
        language: str = "en",
        on_refused: OnRefused = lambda _request, _why: None,
        watch: Callable[[Client], Cause | None] | None = None,
        group: str | None = None,
    ) -> None:
        self._clock, self._say, self._language, self._take_reader = clock, say, language, watch
        self._doorkeeper = Doorkeeper(say, group)
        self._turn_s: float | None = None  # when the present turn began
        self._closing, self._clients = False, set[Client]()
        self._receive = partial(Reception, handler, self._reply, language, on_refused)
        self._reception = self._receive()
        self._accept_s = -inf  # nobody is accepted before this
        self._selector = selectors.DefaultSelector()
        self._name, self._name_s = SocketName(path, None if group is None else group_id(group)), clock()
        self._listener = self._name.listener
        self._lost: Cause | None = None
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)

    def start(self) -> None:
        """Begin to answer."""
        self._thread.start()

    def stalled(self, now_s: float) -> bool:
        """True if the thread has died, or one turn has taken far too long."""
        began_s = self._turn_s
        return not self._thread.is_alive() or (began_s is not None and now_s - began_s > STALL_S)

    def close(self) -> None:
        """Stop listening and remove the socket's name."""
        self._closing = True
        self._name.remove()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)  # which wakes the thread; it closes the rest
        if not self._thread.is_alive():
            self._listener.close()

    def _run(self) -> None:
        try:
            while not self._closing:
                self._listen_again(self._clock())
                ready = self._selector.select(self._patience_s)
                self._turn_s, began_s = self._clock(), thread_time()
                try:
                    self._turn([key.fileobj for key, _ in ready], self._turn_s)
                except Exception as error:  # noqa: BLE001 - a defect here must not prevent the next stop
                    self._begin_anew(error)
                self._turn_s = None
                sleep(min(REST * (thread_time() - began_s), REST_S))
        finally:
            for client in tuple(self._clients):
                self._drop(client)
            self._listener.close()
            self._selector.close()

    def _begin_anew(self, error: Exception) -> None:
        """Start over, without the clients present when it happened."""
        self._complain(Cause.of("socket_internal", error=repr(error)))
        for client in tuple(self._clients):
            self._drop(client)
        self._reception = self._receive()

    @property
    def _patience_s(self) -> float:
        """How long to wait for events before the next turn."""
        if self._reception.busy:
            return POLL_S
        return TICK_S if self._clients or self._accept_s > -inf else NAME_S

    def _turn(self, ready: list[object], now_s: float) -> None:
        """Read from all ready clients, then act."""
        if self._listener in ready:
            self._accept(now_s)
        for client in ready:
            if isinstance(client, Client) and client in self._clients:
                self._serve(client, now_s)
        self._reception.work(now_s)
        for client in [client for client in self._clients if now_s > client.end_s]:
            self._drop(client)
        if now_s - self._name_s >= NAME_S:
            self._name_s = now_s
            self._look_for_name()

    # --- clients come and go ---

    def _listen_again(self, now_s: float) -> None:
        if now_s >= self._accept_s and self._listener not in self._selector.get_map():
            self._accept_s = -inf
            self._selector.register(self._listener, selectors.EVENT_READ)

    def _accept(self, now_s: float) -> None:
        for _ in range(TURN_CLIENTS):
            if len(self._clients) >= MAX_CLIENTS and not self._make_room():
                self._pause_accepting(now_s)  # all clients have requested a stop, and are being answered
                return
            try:
                connection, _ = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as error:  # this client has left already, or there are too many open files
                if error.errno not in CLOSED:
                    self._pause_accepting(now_s)
                return
            try:
                self._take_in(Client(connection, now_s), now_s)
            except OSError:
                connection.close()

    def _take_in(self, client: Client, now_s: float) -> None:
        """Turn away other users; read at once, because the request has mostly arrived already."""
        refusal = self._doorkeeper.refusal(client, now_s)
        self._selector.register(client, selectors.EVENT_READ)
        self._clients.add(client)
        if refusal is None:
            self._serve(client, now_s)
        else:
            self._refuse(client, refusal, now_s)

    def _pause_accepting(self, now_s: float) -> None:
        self._accept_s = now_s + RETRY_S
        self._selector.unregister(self._listener)

    def _make_room(self) -> bool:
        """Drop the longest idle client; if all have made a request, one whose request is not being carried out."""
        others = self._clients - self._reception.stopping
        if others:
            self._drop(min(others, key=lambda client: (bool(client.line), client.heard_s)))
        return bool(others)

    def _drop(self, client: Client) -> None:
        self._clients.discard(client)
        self._reception.forget(client)
        with suppress(KeyError, ValueError):
            self._selector.unregister(client)
        client.close()

    # --- what they say, and are told ---

    def _serve(self, client: Client, now_s: float) -> None:
        """Continue with one client that has sent something, or can take more of its answer."""
        try:
            if client.answering:
                self._write(client)
            elif client.hear(now_s):
                self._selector.unregister(client)
                client.request = {**parse_request(client.line), "uid": client.uid}
                if not self._hands_over(client):
                    self._reception.take(client, now_s)
        except RequestError as error:
            self._refuse(client, error.cause, now_s)
        except OSError:
            self._drop(client)

    def _hands_over(self, client: Client) -> bool:
        """Whether it wants to be told of changes: then it is no client of this thread any more."""
        if self._take_reader is None or client.request.get("verb") != WATCH:
            return False
        self._clients.discard(client)
        if (why := self._take_reader(client)) is not None:
            self._clients.add(client)
            raise RequestError(why)
        return True

    def _refuse(self, client: Client, why: Cause, now_s: float) -> None:
        self._reply(client, encode(refused(why, self._language)), now_s)

    def _reply(self, client: Client, text: bytes, now_s: float) -> None:
        if client not in self._clients:
            return
        with suppress(KeyError):
            self._selector.unregister(client)
        client.answer(text, now_s)
        try:
            self._write(client)
        except OSError:
            self._drop(client)

    def _write(self, client: Client) -> None:
        if client.write():
            self._drop(client)
        elif client not in self._selector.get_map():
            self._selector.register(client, selectors.EVENT_WRITE)

    # --- the name that they find it by ---

    def _look_for_name(self) -> None:
        """Check the socket's name: if somebody removes or rebinds it, nobody can stop a bay here any more."""
        if self._closing or (found := self._name.look()) is None:
            return
        if self._name.listener is self._listener:
            self._complain(found)
            return
        with suppress(KeyError):
            self._selector.unregister(self._listener)
        self._listener.close()
        self._listener, self._lost = self._name.listener, None
        self._say(found)

    def _complain(self, trouble: Cause) -> None:
        if trouble != self._lost:
            self._lost = trouble
            self._say(trouble)

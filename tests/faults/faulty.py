"""A service that answers slowly, wrongly or not at all: an HTTP proxy before one that is well."""

import random
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

WELL, SLOW, ERROR, RESET, CUT = "well", "slow", "error", "reset", "cut"
BUSY = b"<?xml version='1.0'?><Error><Code>SlowDown</Code><Message>busy</Message></Error>"
HOP = {"connection", "transfer-encoding", "keep-alive", "content-length"}


@dataclass
class Faults:
    """How often which fault happens to a request, drawn by a seed."""

    shares: dict[str, float]
    seed: int = 0
    delay_s: float = 1.0
    """of a slow answer"""
    happened: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._draws, self._mutex = random.Random(self.seed), threading.Lock()

    def draw(self) -> str:
        """Return what happens to the next request."""
        with self._mutex:
            names, shares = [*self.shares, WELL], list(self.shares.values())
            (fault,) = self._draws.choices(names, [*shares, 1.0 - sum(shares)])
            self.happened[fault] += 1
            return fault


@contextmanager
def faulty(url: str, faults: Faults) -> Iterator[str]:
    """Serve what another address serves, with faults; yield the address."""

    class Handler(_Handler):
        pass

    Handler.to, Handler.faults = urlsplit(url).netloc, faults
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    to: str
    faults: Faults

    def _pass_on(self) -> None:
        body = self._body()
        fault = self.faults.draw()
        if fault == SLOW:
            time.sleep(self.faults.delay_s)
        elif fault == ERROR:  # before anything was done
            self._answer(503, {"Content-Type": "application/xml"}, BUSY)
            return
        elif fault == RESET:
            self._reset()
            return
        connection = HTTPConnection(self.to, timeout=60)
        try:
            headers = {n: v for n, v in self.headers.items() if n.lower() not in HOP}
            connection.request(self.command, self.path, body, headers)
            found = connection.getresponse()
            answer = found.read()
            told = {n: v for n, v in found.getheaders() if n.lower() not in HOP}
            length = found.getheader("Content-Length", str(len(answer)))
        finally:
            connection.close()
        if fault == CUT:  # it was done, but nobody is told all of the answer
            self._answer(found.status, told, answer[: len(answer) // 2], length)
            self._reset()
        else:
            self._answer(found.status, told, answer, length)

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = _pass_on  # noqa: N815

    def _body(self) -> bytes:
        if self.headers.get("Expect", "").lower() == "100-continue":
            self.send_response_only(100)
            self.end_headers()
        if self.headers.get("Transfer-Encoding", "").lower() != "chunked":
            return self.rfile.read(int(self.headers.get("Content-Length", 0)))
        parts = []
        while size := int(self.rfile.readline().split(b";")[0], 16):
            parts.append(self.rfile.read(size))
            self.rfile.readline()
        while self.rfile.readline().strip():
            pass  # trailers
        return b"".join(parts)

    def _answer(
        self, status: int, headers: dict[str, str], body: bytes, length: str | None = None
    ) -> None:
        self.send_response_only(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("Content-Length", length or str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def _reset(self) -> None:
        self.close_connection = True
        self.wfile.flush()
        # no farewell: the other side's read fails
        linger = struct.pack("ii", 1, 0)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        self.connection.shutdown(socket.SHUT_RDWR)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""

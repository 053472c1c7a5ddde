"""A local server that speaks S3."""

from __future__ import annotations

import socket
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

import pytest

from algid.base.stores import connect

DENIED = (
    b"<?xml version='1.0'?><Error><Code>AccessDenied</Code><Message>Access Denied</Message></Error>"
)


@dataclass
class Served:
    """A bucket of its own, and the query behind an S3 URL.

    `asked` has the method, path and authorization of each request, `denied` says which are
    answered by 403, and `after` is called once a GET of a path is answered.
    """

    bucket: str
    query: str
    asked: list[tuple[str, str, str]] = field(default_factory=list)
    denied: Callable[[str, str], bool] = lambda _method, _path: False
    after: Callable[[str], None] = lambda _path: None

    def url(self, name: str, user: str = "") -> str:
        """The URL of an object or of a prefix."""
        return f"s3://{user}{self.bucket}/{name}{self.query}"

    def replace(self, name: str, content: bytes) -> None:
        """Another object in the place of one, by no request: for use while one is answered."""
        from moto.backends import get_backend

        get_backend("s3")["123456789012"]["aws"].put_object(self.bucket, name, content)

    def watched(self, app: Callable[..., Iterable[bytes]]) -> Callable[..., Iterable[bytes]]:
        """The application, its requests noted."""

        def answer(environ: dict[str, Any], start: Any) -> list[bytes]:
            method, path = (
                environ["REQUEST_METHOD"],
                environ["PATH_INFO"].encode("latin-1").decode(),
            )
            self.asked.append((method, path, environ.get("HTTP_AUTHORIZATION", "")))
            if self.denied(method, path):
                start("403 Forbidden", [("Content-Type", "application/xml")])
                return [] if method == "HEAD" else [DENIED]
            content = list(app(environ, start))
            if method == "GET":
                self.after(path)
            return content

        return answer


@contextmanager
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    """A server with a bucket that no other test sees (moto keeps them for the process).

    Skips where moto is absent.
    """
    server = pytest.importorskip("moto.server", reason="moto is absent")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    running = server.ThreadedMotoServer(ip_address="127.0.0.1", port=port, verbose=False)
    running.start()
    place = quote(f"127.0.0.1:{port}")
    served = Served(
        f"lab-{uuid.uuid4().hex}",
        f"?scheme=http&endpoint_override={place}&region=us-east-1&allow_bucket_creation=true",
    )
    running._server.app = served.watched(running._server.app)
    try:
        connect(served.url(""))[0].create_dir(served.bucket)
        yield served
    finally:
        running.stop()

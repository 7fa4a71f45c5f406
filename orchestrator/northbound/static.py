"""The page's files: read once, at the start, so that a request can name none but these."""

import gzip
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

from orchestrator.model import Cause
from orchestrator.northbound.refusal import RefusalError

HERE = Path(__file__).parent / "static"
INDEX = "index.html"
#: The kinds of file that the page may have; others are not served.
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".webmanifest": "application/manifest+json",
}
#: What gains nothing by being packed again.
PACKED = frozenset({".png", ".woff2", ".ico"})


@dataclass(frozen=True, slots=True)
class File:
    """One file, ready to be sent."""

    data: bytes
    packed: bytes | None  #: gzip, if that is shorter
    type: str
    tag: str  #: changes with the content

    @classmethod
    def of(cls, path: Path) -> "File":
        """A file as it is now."""
        data = path.read_bytes()
        packed = None if path.suffix in PACKED else gzip.compress(data, mtime=0)
        tag = f'"{hashlib.sha256(data).hexdigest()[:32]}"'
        return cls(data, packed if packed and len(packed) < len(data) else None, TYPES[path.suffix], tag)


class Static:
    """The files below a folder, by their path in it."""

    def __init__(self, folder: Path = HERE) -> None:
        found = sorted(path for path in folder.rglob("*") if path.suffix in TYPES and path.is_file())
        self.files: Mapping[str, File] = {path.relative_to(folder).as_posix(): File.of(path) for path in found}

    async def file(self, request: Request) -> Response:
        """One of them."""
        return self._response(request.path_params["path"], request)

    async def index(self, request: Request) -> Response:
        """The page: it finds out by its address what to show."""
        return self._response(INDEX, request)

    def _response(self, path: str, request: Request) -> Response:
        file = self.files.get(path)
        if file is None:
            raise RefusalError(404, Cause("nothing_here"))
        # To be asked for again each time, and answered with 304: an update is seen at once, and costs one short answer.
        headers = {"etag": file.tag, "cache-control": "no-cache", "vary": "accept-encoding"}
        if file.tag in (tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")):
            return Response(status_code=304, headers=headers)
        if file.packed and "gzip" in request.headers.get("accept-encoding", ""):
            return Response(file.packed, headers={**headers, "content-type": file.type, "content-encoding": "gzip"})
        return Response(file.data, headers={**headers, "content-type": file.type})

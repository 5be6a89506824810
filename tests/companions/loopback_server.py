"""A web server on this computer alone, which serves a folder, in parts too, and counts what it sends."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


class LoopbackServer(ThreadingHTTPServer):
    """Where it is, how many bytes of files it has sent, and how it behaves."""

    daemon_threads = True
    sent = 0
    parts = True  # whether it takes range requests
    forbidden = False
    most = float("inf")  # after so many bytes it hangs up

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class _Handler(SimpleHTTPRequestHandler):
    server: LoopbackServer

    def do_GET(self) -> None:
        path = Path(self.translate_path(self.path))
        if path.is_dir():
            return super().do_GET()
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if self.server.forbidden or not path.is_file():
            return self.send_error(403 if self.server.forbidden else 404)
        content = path.read_bytes()
        if self.server.sent > self.server.most:
            return self.connection.close()
        if asked and self.server.parts:
            first, last = int(asked[1]), min(int(asked[2]), len(content) - 1)
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(content)}")
            content = content[first : last + 1]
        else:
            self.send_response(200)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Last-Modified", self.date_time_string(path.stat().st_mtime))
        self.end_headers()
        if self.command == "GET":
            self.server.sent += len(content)
            self.wfile.write(content)
        return None

    def do_HEAD(self) -> None:
        self.do_GET()

    def log_message(self, *words: object) -> None:
        pass


@contextmanager
def served(folder: Path) -> Iterator[LoopbackServer]:
    """Yield a server of a folder."""
    with LoopbackServer(("127.0.0.1", 0), partial(_Handler, directory=str(folder))) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()

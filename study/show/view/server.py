"""A page shown to this machine's browser only: a server on the loopback address that has one answer."""

from __future__ import annotations

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from softjaw.study.messages import USAGE, StudyError

LOOPBACK = "127.0.0.1"
OWN_NAMES = (LOOPBACK, "localhost")
# The page itself says what it may load; here it is kept from other pages and from caches.
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


def server(html: str, port: int = 0) -> ThreadingHTTPServer:
    """A server of one page at ``/``; port 0 takes a free one.

    Raises
    ------
    StudyError
        If the port cannot be had.
    """
    content = html.encode()

    class Handler(BaseHTTPRequestHandler):
        timeout = 10.0  # s that a request may take to arrive
        server_version, sys_version = "softjaw", ""

        def do_GET(self) -> None:  # the name that http.server looks for
            # a page from elsewhere must not read this one by a name of its own for this address
            known = self.headers.get("Host", "").rpartition(":")[0] in OWN_NAMES and self.path == "/"
            self.send_response(200 if known else 404)
            about = {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(content) if known else 0)}
            for name, value in {**about, **HEADERS}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content if known else b"")

        def log_message(self, *_: object) -> None:
            """Nothing: the terminal shows the address."""

    try:
        return ThreadingHTTPServer((LOOPBACK, port), Handler)
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or error
        raise StudyError(USAGE, f"--port: {port} cannot be had ({why}); leave it out for a free one") from error


def serve(html: str, port: int) -> None:
    """Show a page until Ctrl-C, and say where."""
    with server(html, port) as running:
        number = running.server_address[1]
        print(f"open http://{LOOPBACK}:{number}/ in a browser on this machine; Ctrl-C ends", flush=True)
        print(f"from another machine: ssh -L {number}:{LOOPBACK}:{number} and the same address there", flush=True)
        try:
            running.serve_forever()
        except KeyboardInterrupt:
            print()

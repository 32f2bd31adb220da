"""Server of the explorer, on this machine only."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Sequence
from typing import Any

import panel as pn

from jbeamshell.common.errors import InputError
from jbeamshell.explorer.page import Page
from jbeamshell.measured.loops import Loop
from jbeamshell.scene.scene import Scene

HERE = "127.0.0.1"
TITLE = "jbeamshell explore"
HEAD = """{% block preamble %}
<meta name="viewport" content="width=device-width, initial-scale=1">
{% endblock %}"""  # without it a phone shows the page as small as a desk's


def serve(
    scene: Scene | None = None,
    loops: Sequence[Loop] = (),
    name: str = "",
    *,
    port: int = 0,
    browser: bool = True,
    tell: Callable[[str], None] = print,
) -> None:
    """Serve the page on this machine until it is interrupted.

    Parameters
    ----------
    scene, loops, name : see `Page`
    port : port of 127.0.0.1; 0 is any that is free
    browser : True to open the page in the browser
    tell : called with the page's address once it can be opened

    Raises
    ------
    InputError
        if the port is not free
    """
    Page(scene, loops, name)  # compiles before anybody waits
    port = _free(port)

    def layout() -> Any:
        document: Any = pn.state.curdoc
        document.template = HEAD
        return Page(scene, loops, name).layout

    server = pn.serve(
        {"/": layout},
        port=port,
        address=HERE,
        websocket_origin=[f"{HERE}:{port}", f"localhost:{port}"],
        title=TITLE,
        show=browser,
        start=False,
        verbose=False,
    )
    server.start()
    tell(f"http://{HERE}:{port}/")
    with contextlib.suppress(KeyboardInterrupt):
        server.io_loop.start()
    server.stop()


def _free(port: int) -> int:
    """The port, or any free one for 0; raises `InputError` if it is taken."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HERE, port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            fix = "take another port, or 0 for any"
            raise InputError(f"--port = {port}: {reason}: {fix}") from None
        return int(probe.getsockname()[1])

"""The server behind the page: its routes, and the command's main function."""

import asyncio
import os
import secrets
import socket
import webbrowser
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import orjson
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from fastgen.classes import BACKGROUND_ID
from fastgen.config.assignments import changed
from fastgen.errors import ConfigError, FastgenError, OutputError
from fastgen.generator import Generator
from fastgen.light.hdri import bundled_hdris, hdris_by_name
from fastgen.render.settings import QUALITY, RenderSettings
from fastgen.render.variant import LAYERS
from fastgen.sample import Sample
from fastgen.studio.changes import Base, as_file, command, values_of
from fastgen.studio.controls import MOST_USED, controls
from fastgen.studio.drawing import Drawing, Superseded, Wanted
from fastgen.studio.guard import Guard
from fastgen.studio.layers import (
    PICTURE_LAYERS,
    depth_range,
    layer_image,
    object_records,
    pixel_values,
    thumbnail,
)
from fastgen.validation import check_known, whole

_PAGE = Path(__file__).parent / "page"

_KEPT = 4
"""Rendered images whose layers can be fetched: a draft and a refined one for each side."""

_LONGEST_BODY = 512 << 10
"""Most bytes of a request."""

_BYTES = "application/octet-stream"

_SIDES = ("a", "b")

_LONGEST_SLEEP_S = 0.2
"""Longest time until a request that waits for its image notices that the server ends."""

_LONGEST_SHUTDOWN_S = 2
"""Longest time that the server waits for open connections when it ends."""


class Studio:
    """Answers of the server.

    Args:
        drawing: Renders the images.
        settings: Size, backend, device and HDRI folder of the images; the quality of the command.
        bases: Configurations to start from by name, see changes.bases.
        seed: Seed to begin with.
    """

    def __init__(
        self, drawing: Drawing, settings: RenderSettings, bases: Mapping[str, Base], seed: int
    ) -> None:
        """Check the HDRI folder and the seed; nothing is rendered yet."""
        self._drawing = drawing
        self._settings = settings
        self._bases = dict(bases)
        self._seed = whole("seed", seed)
        folder = settings.hdri_dir
        self._hdris = bundled_hdris() if folder is None else hdris_by_name(folder)
        self._samples: OrderedDict[int, Sample] = OrderedDict()
        self._count = 0
        first = next(iter(self._bases.values()))
        self._weights = Generator.of(first.config, self._seed, settings).environments
        self._is_stopping: Callable[[], bool] = lambda: False
        self._thumbnail = lru_cache(lambda name: thumbnail(self._hdris[name]))

    def app(self, token: str, is_stopping: Callable[[], bool] = lambda: False) -> Starlette:
        """Return the application.

        Args:
            token: First part of the path of every valid address.
            is_stopping: Whether the server ends. Requests then no longer wait for their image.
        """
        self._is_stopping = is_stopping
        routes = [
            Route("/controls", self._controls),
            Route("/draw", self._draw, methods=["POST"]),
            Route("/pictures/{number:int}/pixels", self._pixels),
            Route("/pictures/{number:int}/{layer}", self._layer),
            Route("/hdri/{name}.jpg", self._hdri),
            Mount("/", StaticFiles(directory=_PAGE, html=True)),
        ]
        return Starlette(
            routes=routes,
            middleware=[Middleware(Guard, token=token)],
            exception_handlers={FastgenError: _refused},
        )

    def _base(self, name: Any) -> Base:
        check_known("preset", name, tuple(self._bases))
        return self._bases[name]

    def _controls(self, request: Request) -> Response:
        """Everything that the page shows before the first image, for one preset."""
        name = request.query_params.get("preset", next(iter(self._bases)))
        base = self._base(name)
        return _json(
            {
                "presets": list(self._bases),
                "preset": name,
                "seed": self._seed,
                "size": self._settings.size,
                "quality": self._settings.quality,
                "qualities": list(QUALITY),
                "materials": LAYERS,
                "layers": PICTURE_LAYERS,
                "hdris": self._weights,
                "cameras": list(base.config.cameras),
                "most_used": MOST_USED,
                "controls": controls(base.config),
            }
        )

    async def _draw(self, request: Request) -> Response:
        """Render one image, and return its labels and the number by which its layers are found."""
        data = await _body(request)
        check_known("side", data.get("side"), _SIDES)
        base = self._base(data.get("preset"))
        future = self._drawing.draw(data["side"], lambda: _wanted(base, data))
        image = asyncio.wrap_future(future)
        while not image.done():
            await asyncio.wait({image}, timeout=_LONGEST_SLEEP_S)
            if self._is_stopping():
                raise HTTPException(503, "the server ends")
        try:
            drawn = image.result()
        except Superseded:
            return _json({"superseded": True}, 409)
        self._count += 1
        self._samples[self._count] = sample = drawn.sample
        if len(self._samples) > _KEPT:
            self._samples.popitem(last=False)
        file = as_file(drawn.wanted.config, base.preset)
        settings = replace(self._settings, quality=data.get("refined", self._settings.quality))
        return _json(
            {
                "number": self._count,
                "ms": round(1000 * drawn.seconds),
                "camera": sample.camera.name,
                "environment": sample.scene.environment.name,
                "depth": depth_range(sample),
                "background_id": BACKGROUND_ID,
                "objects": object_records(sample),
                "yaml": file,
                "command": command(base.preset, bool(file), drawn.wanted.seed, settings),
            }
        )

    def _layer(self, request: Request) -> Response:
        # neither side spends time on a codec: on one machine, bytes cost nothing
        image = layer_image(self._sample(request), request.path_params["layer"])
        return Response(image.tobytes(), media_type=_BYTES)

    def _pixels(self, request: Request) -> Response:
        return Response(pixel_values(self._sample(request)), media_type=_BYTES)

    def _sample(self, request: Request) -> Sample:
        number = request.path_params["number"]
        try:
            return self._samples[number]
        except KeyError:
            raise HTTPException(404, f"image {number} was replaced by a newer one") from None

    def _hdri(self, request: Request) -> Response:
        name = request.path_params["name"]
        check_known("hdri", name, tuple(self._hdris))
        return Response(self._thumbnail(name), media_type="image/jpeg")


def _wanted(base: Base, data: Mapping[str, Any]) -> Wanted:
    """Return the checked image that a request describes."""
    changes = data.get("changes", {})
    if not isinstance(changes, dict):
        raise ConfigError("changes: expected a mapping of keys to YAML text")
    return Wanted(
        config=changed(base.config, values_of(changes)),
        seed=whole("seed", data.get("seed")),
        index=whole("index", data.get("index")),
        camera=data.get("camera"),
        quality=data.get("quality", "draft"),
        material=data.get("material", "all"),
        normals=data.get("normals") is True,
        background=data.get("background") is True,
    )


async def _body(request: Request) -> dict[str, Any]:
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > _LONGEST_BODY:
            raise HTTPException(413, f"a request has at most {_LONGEST_BODY} bytes")
    try:
        data = orjson.loads(body)
    except orjson.JSONDecodeError:
        data = None
    if not isinstance(data, dict):
        raise HTTPException(400, "expected a JSON object")
    return data


def _json(data: Any, status: int = 200) -> Response:
    return Response(orjson.dumps(data), status, media_type="application/json")


def _refused(_: Request, error: Exception) -> Response:
    return _json({"error": str(error)}, 422)


def listening(port: int) -> socket.socket:
    """Return a socket that listens on a port of the loopback interface.

    Args:
        port: Port, or 0 for a free one.

    Raises:
        ConfigError: It is not a port.
        OutputError: The port is in use or reserved.
    """
    try:
        return socket.create_server(("127.0.0.1", whole("port", port, 0, 65535)))
    except OSError as error:
        reason = os.strerror(error.errno or 0).lower()  # its own words name the address again
        raise OutputError(
            f"port: {port} cannot be used ({reason}); give another one, or none for a free one"
        ) from None


def run(
    settings: RenderSettings,
    bases: Mapping[str, Base],
    seed: int,
    port: int,
    show: Callable[[str], None],
    browser: bool = True,
) -> None:
    """Serve the page until Ctrl-C or SIGTERM, which then raise KeyboardInterrupt.

    Args:
        settings, bases, seed: See Studio.
        port: Port of the loopback interface, or 0 for a free one.
        show: Prints the address of the page.
        browser: Open the page in the default browser.

    Raises:
        ConfigError: An argument is not valid.
        OutputError: The port is in use.
    """
    with listening(port) as server, Drawing(settings) as drawing:
        token = secrets.token_urlsafe(16)
        studio = Studio(drawing, settings, bases, seed)
        options = uvicorn.Config(
            studio.app(token, lambda: listener.should_exit),
            lifespan="off",
            ws="none",
            log_level="warning",
            timeout_graceful_shutdown=_LONGEST_SHUTDOWN_S,
        )
        listener = uvicorn.Server(options)
        address = f"http://127.0.0.1:{server.getsockname()[1]}/{token}/"
        show(address)
        if browser:
            webbrowser.open(address)
        listener.run(sockets=[server])

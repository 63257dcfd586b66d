"""Send records to a page through its WebSocket."""

import asyncio
import contextlib
from collections.abc import AsyncIterator

from starlette.websockets import WebSocket, WebSocketDisconnect

from uavrt.ground.page_listeners import encode
from uavrt.ground.session import GroundSession

MAX_PAGE_NAME = 64


async def send_records(session: GroundSession, websocket: WebSocket) -> None:
    """Send the complete state of a session, then each record."""
    await websocket.accept()
    hub, commander = session.vehicle.feed.hub, session.commander
    queue = hub.listen()
    page = websocket.query_params.get("page", "")[:MAX_PAGE_NAME]
    if page:
        commander.page_connected(page)
    hello = {"topic": "hello", "record": session.hello()}
    listening = asyncio.create_task(_until_closed(websocket))
    try:
        await websocket.send_text(encode(hello).decode())
        async for text in _texts(queue, listening):
            await websocket.send_text(text)
        with contextlib.suppress(RuntimeError):
            await websocket.close(1001)
    except (WebSocketDisconnect, RuntimeError):
        pass  # the browser went away while we were sending
    finally:
        listening.cancel()
        hub.leave(queue)
        if page:
            commander.page_disconnected(page)


async def _texts(
    queue: asyncio.Queue[str | None], until: "asyncio.Task[None]"
) -> AsyncIterator[str]:
    """Yield the texts of a queue until the queue or the task ends."""
    while not until.done():
        getting = asyncio.ensure_future(queue.get())
        await asyncio.wait({getting, until}, return_when=asyncio.FIRST_COMPLETED)
        if not getting.done():
            getting.cancel()
            return
        text = getting.result()
        if text is None:
            return
        yield text


async def _until_closed(websocket: WebSocket) -> None:
    """Discard incoming messages until the page disconnects."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        while True:
            message = await websocket.receive()
            if message["type"] == "websocket.disconnect":
                return

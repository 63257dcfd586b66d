"""Routes of the tag table."""

from dataclasses import asdict
from typing import Any

from starlette.requests import Request

from uavrt.core.messages import Tag
from uavrt.ground.link.served_vehicle import ServedVehicle
from uavrt.ground.store import tag_table
from uavrt.ground.web.routes.routing import Answer, Row, download, json_body
from uavrt.ground.web.work.foreign_requests import checked_tags, imported_tags
from uavrt.ground.web.work.foreign_worker import ForeignWorker


class TagApi:
    """Routes for the tags of one vehicle."""

    def __init__(self, vehicle: ServedVehicle, worker: ForeignWorker) -> None:
        self._vehicle, self._worker = vehicle, worker

    def routes(self) -> list[Row]:
        """List the routes of the tag table."""
        return [
            Row("/tags", "GET", self.tags),
            Row("/tags", "PUT", self.put, commands=True),
            Row("/tags/check", "POST", self.check),
            Row("/tags/import", "POST", self.read),
            Row("/tags/{name}", "GET", self.export),
        ]

    async def tags(self, request: Request) -> Any:
        """Return the rows of the tag table."""
        return tag_table.rows_from_tags(self._vehicle.store.tags)

    async def put(self, request: Request) -> Any:
        """Store the tag table if it has no faults and no other page has changed it.

        ``If-Match: "VERSION"`` names the version that this page has edited; without it, any is
        replaced.
        """
        rows = await json_body(request)
        tags, faults = await self._worker.call(tag_table.tags_from_rows, rows)
        if faults:
            return Answer(422, {"faults": [asdict(fault) for fault in faults]})
        store = self._vehicle.store
        wanted = request.headers.get("if-match", "*").strip('" ')

        def keep() -> bool:
            same = wanted in ("*", tag_table.table_version(store.tags))
            if same:
                store.set_tags(tags)
            return same

        if not await store.disk.run(keep):
            changed = "another page has changed the tags in the meantime"
            return Answer(412, {"error": changed, **_table(store.tags)})
        self._vehicle.show_tags()
        return {"faults": [], **_table(tags)}

    async def check(self, request: Request) -> Any:
        """Check a table while it is typed; return its faults, or else its warnings."""
        checked = await self._worker.call(checked_tags, await request.body())
        return checked | {"faults": [asdict(fault) for fault in checked["faults"]]}

    async def read(self, request: Request) -> Any:
        """Read tags from files, and which tags the files deselect; nothing is stored yet."""
        return await self._worker.call(imported_tags, await request.body())

    async def export(self, request: Request) -> Any:
        """Return the tag table as a file."""
        name = request.path_params["name"]
        text = tag_table.export_text(self._vehicle.store.tags, name)
        return download(text.encode(), name, "text/plain; charset=utf-8")


def _table(tags: tuple[Tag, ...]) -> dict[str, Any]:
    return {"tags": tag_table.rows_from_tags(tags), "version": tag_table.table_version(tags)}

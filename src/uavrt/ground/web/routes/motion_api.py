"""Routes by which a page requests motions of a drone."""

import asyncio
from typing import Any

from starlette.requests import Request

from uavrt.ground.link.motions.page_motions import MotionCommands
from uavrt.ground.store.ground_settings import GroundStore
from uavrt.ground.web.routes.routing import Row, json_object, page_of
from uavrt.ground.web.work.foreign_requests import area_in_body
from uavrt.ground.web.work.foreign_worker import ForeignWorker
from uavrt.ground.web.work.plan_maps import PlanMapRequest, plan_map_jobs


class MotionApi:
    """Routes for the motions of one vehicle's drone."""

    def __init__(
        self, flying: MotionCommands, store: GroundStore, worker: ForeignWorker
    ) -> None:
        self._flying, self._store, self._worker = flying, store, worker
        self._foresight = plan_map_jobs()

    def routes(self) -> list[Row]:
        """List the routes for motions of the drone."""
        return [
            Row("/motion/area", "POST", self.area),
            Row("/motion/plan", "POST", self.plan),
            Row("/motion/coverage", "POST", self.coverage),
            Row("/motion/upload", "POST", self.upload, commands=True),
            Row("/motion/ask", "POST", self.request_motion, commands=True),
            Row("/motion/confirm", "POST", self.confirm, commands=True),
            Row("/motion/stop", "POST", self.stop),
        ]

    async def area(self, request: Request) -> Any:
        """Return the corners of an area, from a file's text or from centre and radius."""
        return await self._worker.call(area_in_body, await request.body())

    async def plan(self, request: Request) -> Any:
        """Preview a motion from data on the ground, without a request to the drone."""
        return self._flying.plan(await json_object(request))

    async def coverage(self, request: Request) -> Any:
        """Return the map of where a tag would be detected along a plan, or its progress."""
        store, wanted = self._store, await json_object(request)
        asked = PlanMapRequest.from_request(wanted, store.tags, store.settings.antenna_choice)
        again = wanted.get("again") is True
        return await asyncio.to_thread(self._foresight.answer, asked, again=again)

    async def upload(self, request: Request) -> Any:
        """Upload a survey to the autopilot as its mission. Nothing moves yet."""
        return await self._flying.upload(await json_object(request), self._worker.call)

    async def request_motion(self, request: Request) -> Any:
        """Request a motion; return the order that the drone proposes. Nothing moves yet."""
        return await self._flying.request_motion(await json_object(request), page_of(request))

    async def confirm(self, request: Request) -> Any:
        """Confirm an order, ``{"order_id": …, "sticks_unseen": false}``; the drone moves."""
        return await self._flying.confirm(await json_object(request), page_of(request))

    async def stop(self, request: Request) -> Any:
        """Stop the drone. Every page may do this."""
        return await self._flying.stop()

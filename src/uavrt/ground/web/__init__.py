"""The web server of the ground station: routes, access control, and the data they serve.

`server` opens the sockets, `guard` decides who may connect, `api`, `drone_flights` and
`fleet_api` are the routes, `page` joins fleet and server. The other modules answer requests:
tag tables, maps, reports, exports, waterfalls, and which buttons are enabled.
"""

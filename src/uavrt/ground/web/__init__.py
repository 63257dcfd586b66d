"""The web server of the ground station: routes, access control, and the data they serve.

`server` opens the sockets, and `access/guard` decides who may connect. `routes/api`,
`routes/drone_flights` and `routes/fleet_api` are the routes; `page_program` joins fleet and
server. The other modules serve tag tables, maps, reports, exports and waterfalls.
"""

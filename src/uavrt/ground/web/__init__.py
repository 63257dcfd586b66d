"""The web server of the ground station: routes, access control, and the data they serve.

`server` opens the sockets, `access/guard` decides who may connect, `routes` has the requests,
`work` their calculations, and `page_program` joins fleet and server.
"""

"""The ground station.

`session` is all that one vehicle is to it, `fleet` several vehicles on the same links,
`station` one without a page. `link` talks to drones, `fetch` brings their files, `store` keeps
flights and settings, `web` serves the page.
"""

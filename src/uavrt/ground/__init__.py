"""The ground station: `link` talks to drones, `fetch` downloads their files, `store` keeps
flights and settings, `web` serves the page. `session` serves one vehicle, `fleet` several on
the same links, `station` runs without a page.
"""

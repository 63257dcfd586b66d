"""``{uavrt-settings}``: the settings file, all its keys and defaults, out of the code."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from uavrt.config.loader import default_settings_text


class Settings(SphinxDirective):
    """The text that the configuration writes for a new user."""

    def run(self) -> list[nodes.Node]:
        """Show it as a block of TOML."""
        text = default_settings_text()
        return [nodes.literal_block(text, text, language="toml")]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("uavrt-settings", Settings)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

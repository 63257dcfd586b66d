"""Write user-entered text safely into XML."""

from xml.etree import ElementTree as ET


def add_text(parent: ET.Element, name: str, text: str | None) -> None:
    """Add an XML element with a text, without control characters, which XML forbids."""
    kept = (c for c in text or "" if c >= " " or c in "\t\n")
    ET.SubElement(parent, name).text = "".join(kept)

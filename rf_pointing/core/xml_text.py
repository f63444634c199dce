"""XML of others, within bounds that keep the time short, and without entities."""

from typing import Any
from xml.etree import ElementTree

from rf_pointing.core.whole_file import DEEPEST


def parse_xml(text: str, kind: str) -> ElementTree.Element:
    """Return the root of an XML text; ValueError for a definition of entities, and too deep a one.

    A malformed one is the ParseError of ElementTree, with its place.
    """
    if (place := text.replace("<!--", "<---").find("<!")) >= 0:
        line = text.count("\n", 0, place) + 1
        raise ValueError(f"line {line}: {kind} XML must not define entities or a document type")
    parser: Any = ElementTree.XMLPullParser(("start", "end"))
    root, depth = ElementTree.Element("none"), 0
    parser.feed(text.strip())
    parser.close()
    for event, element in parser.read_events():
        root = element if depth == 0 and event == "start" else root
        depth += 1 if event == "start" else -1
        if depth > DEEPEST:
            raise ValueError(f"{kind} XML is nested more than {DEEPEST} deep")
    return root


def local_name(tag: str) -> str:
    """Return the name of an XML element without its namespace."""
    return tag.rpartition("}")[2]

"""docs/messages.md is what the comments of msg_defs say."""

import re

from test.scripts import script_module


def test_the_page_has_every_field_and_constant_of_the_definitions_and_is_up_to_date() -> None:
    script = script_module("scripts/message_page.py")
    page = script.message_page()
    assert (script.DEFINITIONS.parent / "docs" / "messages.md").read_text() == page, (
        "run scripts/run-python scripts/message_page.py > docs/messages.md"
    )
    for file in (each for kind in script.PARTS for each in script.DEFINITIONS.glob(f"{kind}/*.{kind}")):
        section = re.split("^#+ ", page.partition(f"\n### {file.stem}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
        named = re.findall(r"^\S+ (\w+)", re.sub("^#.*", "", file.read_text(), flags=re.MULTILINE), re.MULTILINE)
        assert sorted(re.findall(r"(?:^\| |; |, )`(\w+)` ", section, re.MULTILINE)) == sorted(named), file.stem

"""The dictionary of directives and the tables: what a row must have, and which file a mistake is in."""

from pathlib import Path

import pytest

from rf_pointing.operations import AlarmParams
from rf_pointing.operations.dictionary import DirectiveRow, read_directives, read_tables

HEAD = "version: 1\ndirectives:\n"


def test_a_row_is_kind_address_type_and_arguments() -> None:
    rows = read_directives(
        HEAD + "  go: {service: servo/go, type: std_srvs/srv/Trigger, takes: [a, 2]}\n"
        "  track: {action: track, type: p/action/Track}\n  speed: {parameter: servo/speed}\n  7: {own: record}\n"
    )
    assert list(rows.values()) == [
        DirectiveRow(name="go", kind="service", address="servo/go", type_name="std_srvs/srv/Trigger", takes=("a", "2")),
        DirectiveRow(name="track", kind="action", address="track", type_name="p/action/Track", takes=()),
        DirectiveRow(name="speed", kind="parameter", address="servo/speed", type_name="", takes=()),
        DirectiveRow(name="7", kind="own", address="record", type_name="", takes=()),
    ]
    assert list(rows) == ["go", "track", "speed", "7"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[1]", "must have version: 1 and directives"),
        ("version: 2\ndirectives: {}", "must have version: 1 and directives"),
        ("version: 1", "must have version: 1 and directives"),
        ("version: 1\ndirectives: {}\nmore: 1", "must have version: 1 and directives"),
        ("version: 1\ndirectives: [a]", "directives must map names to what they send"),
        (HEAD + "  x: 3", "directive x must have one of service, action, parameter, own"),
        (HEAD + "  x: {}", "directive x must have one of"),
        (HEAD + "  x: {service: a, own: b, type: p/srv/T}", "directive x must have one of"),
        (HEAD + "  x: {own: a, size: 1}", "may have type and takes"),
        (HEAD + "  x: {action: a}", "type='' must be given for a service and an action, and only there"),
        (HEAD + "  x: {own: a, type: p/srv/T}", "type='p/srv/T' must be given for a service and an action, and only"),
        (HEAD + "  x: {parameter: a/b, type: p/srv/T}", "and only there"),
        (HEAD + "  x: {service: a, type: p/action/T}", "must be as in package/srv/Name"),
        (HEAD + "  x: {service: a, type: srv/T}", "must be as in package/srv/Name"),
        (HEAD + "  x: {service: a, type: p/srv/T/U}", "must be as in package/srv/Name"),
        (HEAD + "  x: {action: a, type: p/srv/T}", "must be as in package/action/Name"),
        (HEAD + "  x: {own: ''}", "own='' must name it"),
        (HEAD + "  x: {parameter: ''}", "parameter='' must name it"),
        (HEAD + "  x: {parameter: speed}", "parameter='speed' must name it, a parameter as in node/name"),
    ],
)
def test_a_row_that_cannot_be_sent_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_directives(text)


def test_a_parameter_may_be_deep_in_its_node() -> None:
    assert read_directives(HEAD + "  x: {parameter: ns/servo/a.b}")["x"].address == "ns/servo/a.b"


@pytest.mark.parametrize("key", ["directives", "procedure", "recovery"])
def test_a_file_that_is_missing_or_wrong_is_named(tmp_path: Path, key: str) -> None:
    missing, wrong = tmp_path / "missing.yaml", tmp_path / "wrong.yaml"
    wrong.write_text("[1]")
    with pytest.raises(ValueError, match="missing.yaml cannot be read: No such file"):
        read_tables(AlarmParams(), **{key: str(missing)})
    with pytest.raises(ValueError, match="wrong.yaml: "):
        read_tables(AlarmParams(), **{key: str(wrong)})


def test_a_procedure_of_a_station_may_send_what_it_has_added(tmp_path: Path) -> None:
    own, procedure = tmp_path / "own.yaml", tmp_path / "pass.yaml"
    own.write_text(HEAD + "  lamp: {own: lamp, takes: [level]}\n")
    procedure.write_text("version: 1\nname: p\nblocks: {one: {directives: [{send: lamp, with: {level: 3}}]}}")
    tables = read_tables(AlarmParams(), str(own), str(procedure))
    assert tables.procedure.name == "p"
    assert tables.directives["lamp"].takes == ("level",)
    assert tables.directives["unwind"].takes == ("azimuth", "elevation")
    assert {"lamp", "park"} <= set(tables.directives)
    assert tables.recovery == read_tables(AlarmParams()).recovery
    with pytest.raises(ValueError, match=r"pass.yaml: one.directives\[0\]: send='lamp' must be one of"):
        read_tables(AlarmParams(), procedure=str(procedure))

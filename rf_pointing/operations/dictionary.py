"""Directives that can be sent, in a dictionary, and the tables that a station may change.

A directive is a service or an action by name and type, a parameter of a node, or something that the
executive does itself.  Names are relative to the namespace of the antenna.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rf_pointing.core import names_in, parse_yaml, read_whole
from rf_pointing.operations.alarms import AlarmParams
from rf_pointing.operations.procedure import Procedure, read_procedure
from rf_pointing.operations.recovery import RecoveryTable, read_table

TABLES = Path(__file__).with_name("tables")
"""Folder of the shipped tables; it is installed with the package."""
KINDS = ("service", "action", "parameter", "own")


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectiveRow:
    """One directive: its kind, the name of what it addresses, its type and its arguments."""

    name: str
    kind: str
    address: str
    type_name: str
    takes: tuple[str, ...]


def read_directives(text: str) -> dict[str, DirectiveRow]:
    """Return the rows of a YAML text by name; ValueError names the row."""
    content = parse_yaml(text)
    if not isinstance(content, Mapping) or content.get("version") != 1 or set(content) != {"version", "directives"}:
        raise ValueError("a dictionary of directives must have version: 1 and directives")
    if not isinstance(content["directives"], Mapping):
        raise ValueError("directives must map names to what they send")
    return {str(name): _row(str(name), given) for name, given in content["directives"].items()}


def _row(name: str, given: Any) -> DirectiveRow:
    kinds = [kind for kind in KINDS if isinstance(given, Mapping) and kind in given]
    if len(kinds) != 1 or set(given) - {kinds[0], "type", "takes"}:
        raise ValueError(f"directive {name} must have one of {', '.join(KINDS)}, and may have type and takes")
    kind, type_name = kinds[0], str(given.get("type") or "")
    if (kind in ("service", "action")) != bool(type_name):
        raise ValueError(
            f"directive {name}: type={type_name!r} must be given for a service and an action, and only there"
        )
    wanted = {"service": "srv", "action": "action"}.get(kind, "")
    if wanted and (type_name.count("/") != 2 or type_name.split("/")[1] != wanted):
        raise ValueError(f"directive {name}: type={type_name!r} must be as in package/{wanted}/Name")
    address = str(given[kind] or "")
    if not address or (kind == "parameter" and address.count("/") < 1):
        raise ValueError(f"directive {name}: {kind}={address!r} must name it, a parameter as in node/name")
    return DirectiveRow(
        name=name, kind=kind, address=address, type_name=type_name,
        takes=names_in(f"directive {name}: takes", given.get("takes")),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Tables:
    """Everything that an executive reads from files."""

    directives: Mapping[str, DirectiveRow]
    procedure: Procedure
    scan: Procedure
    recovery: RecoveryTable
    maintenance: Mapping[str, Procedure]
    """Procedures that an operator may start between two passes, by name."""


def read_tables(
    thresholds: AlarmParams, directives: str = "", procedure: str = "", recovery: str = "", maintenance: str = ""
) -> Tables:
    """Return the shipped tables, or those of the files that are named.

    A station's dictionary adds rows to the shipped one and replaces those of the same names; so do
    the procedures of the folder `maintenance`.  `procedure`: a file, or the name of a shipped one.
    Raises ValueError with the file of the first mistake.
    """
    rows = read_directives(read_whole(TABLES / "directives.yaml"))
    rows |= _of(Path(directives), read_directives) if directives else {}
    names = {name: row.takes for name, row in rows.items()}
    shipped = TABLES / f"{procedure or 'pass'}.yaml"
    file = shipped if shipped.is_file() else Path(procedure)
    chosen = _of(file, lambda text: read_procedure(text, names))
    files = [TABLES / "self_test.yaml", *(sorted(Path(maintenance).glob("*.yaml")) if maintenance else ())]
    own = {file.stem: _of(file, lambda text: read_procedure(text, names)) for file in files}
    scan = _of(TABLES / "scan.yaml", lambda text: read_procedure(text, names))
    file = Path(recovery) if recovery else TABLES / "recovery.yaml"
    table = _of(file, lambda text: read_table(text, names, thresholds))
    return Tables(rows, chosen, scan, table, own)


def _of(path: Path, read: Any) -> Any:
    try:
        return read(read_whole(path))
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error

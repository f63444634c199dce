"""The maker of synthetic bags that the tests of the station's report define."""

import importlib.util
from pathlib import Path

_PATH = Path(__file__).parents[2] / "report" / "conftest.py"
_SPEC = importlib.util.spec_from_file_location("synthetic_bags", _PATH)
assert _SPEC is not None
assert _SPEC.loader is not None
_BAGS = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(_BAGS)

types, maker = _BAGS.types, _BAGS.maker

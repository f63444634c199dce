"""A target is a satellite of a file, folder or address, or of the verification set, or a body."""

import json
from pathlib import Path

import pytest

import rf_pointing as rp
from rf_pointing.api.satellite_list import satellites
from rf_pointing.ephemeris import fetching, find_elements, tle_lines, verification_elements
from test.ephemeris.element_server import FRESH, serving


@pytest.fixture
def sky(tmp_path: Path) -> Path:
    """Return a file of six satellites, two of them with one name."""
    lines = []
    for one, name in zip(FRESH[:6], ("A", "B, THE SECOND", "FENGYUN #2", "C=D", "TWIN", "TWIN"), strict=True):
        lines += [name, *tle_lines(one)]
    (tmp_path / "sky.tle").write_text("\n".join(lines))
    return tmp_path / "sky.tle"


def test_a_name_or_number_is_of_the_verification_set_and_a_body_has_no_epoch() -> None:
    cbers = find_elements(verification_elements(), "28057")
    for target in (rp.elements(), rp.elements("CBERS 2"), rp.elements("28057"), rp.elements(satellite=28057)):
        assert (target.name, target.first_t_s, target.file) == (cbers.name, cbers.epoch_t_s, None)
    with pytest.raises(ValueError, match=r"Sun has no epoch: say when to look for it \(start\)"):
        _ = rp.elements("Sun").first_t_s
    with pytest.raises(ValueError, match="Nemesis"):
        rp.elements("Nemesis")


def test_a_file_or_folder_gives_its_first_satellite_or_the_one_named(sky: Path) -> None:
    assert rp.elements(sky).name == "A"
    assert rp.elements(sky.parent, satellite="FENGYUN #2").name == "FENGYUN #2"
    assert {each.satellite for each in rp.catalogue(sky)} == {str(one.catalogue_number) for one in FRESH[:6]}
    for missing in (sky.parent / "no.tle", "no.tle"):
        with pytest.raises(ValueError, match="does not exist"):
            rp.elements(missing)
    with pytest.raises(ValueError, match="does not exist"):
        rp.elements("nowhere", satellite="A")


def test_an_address_is_fetched_and_what_went_wrong_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    number = FRESH[0].catalogue_number
    with serving() as source:
        assert rp.elements(source.address, satellite=number).found == FRESH[0]
        assert len(rp.catalogue(source.address)) == 4
        assert len(source.asked) == 1
        for file in tmp_path.rglob(".*.json"):
            file.write_text(json.dumps(json.loads(file.read_text()) | {"requested_t_s": 0.0}))
        source.status = 500
        fetching.current_elements.cache_clear()
        with pytest.warns(UserWarning, match=r"answered 500 .*; the elements that were confirmed 0\.0 h ago are used"):
            kept = rp.elements(source.address, satellite=number)
    assert kept.file in set(tmp_path.rglob("*.elements"))
    assert kept.found == FRESH[0]


@pytest.mark.parametrize(
    ("entry", "name", "priority", "peak_deg"),
    [
        ("A", "A", 0, 5.0),
        ("B, THE SECOND, priority=-3", "B, THE SECOND", -3, 5.0),
        ("FENGYUN #2 # a comment", "FENGYUN #2", 0, 5.0),
        ("C=D, peak=20.5, priority=1000", "C=D", 1000, 20.5),
        (str(FRESH[0].catalogue_number), "A", 0, 5.0),
    ],
)
def test_a_name_of_a_list_may_hold_what_the_list_uses(
    entry: str, name: str, priority: int, peak_deg: float, sky: Path, tmp_path: Path
) -> None:
    listed = tmp_path / "list.txt"
    listed.write_text(f"# mine\n\n{entry}\n")
    (found,) = satellites(str(sky), [str(listed)], min_peak_deg=5.0)
    assert (found.name, found.priority, found.min_peak_deg) == (name, priority, peak_deg)


def test_a_name_of_two_objects_and_a_list_that_is_no_text_are_refused(sky: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="TWIN"):
        satellites(str(sky), ["TWIN"])
    (tmp_path / "list.txt").write_bytes(bytes(range(128, 256)))
    with pytest.raises(ValueError, match=r"list\.txt is not a list of satellites"):
        satellites(str(sky), [str(tmp_path / "list.txt")])

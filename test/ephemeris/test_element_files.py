"""Where elements are: files, folders, addresses and the folder that keeps what they answered."""

import os
from pathlib import Path

import pytest

from rf_pointing.ephemeris.element_files import cache_folder, element_files, kept_file, version_of

ADDRESS = "https://celestrak.org/NORAD/elements/gp.php?GROUP=active&FORMAT=tle"


def test_the_cache_is_the_folder_that_was_stated_or_that_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere/cache")
    assert cache_folder() == Path("/somewhere/cache/rf_pointing/elements")
    assert cache_folder("mine") == Path("mine")
    # A relative one is to be ignored.
    for base in ("cache", ""):
        monkeypatch.setenv("XDG_CACHE_HOME", base)
        assert cache_folder() == Path.home() / ".cache" / "rf_pointing" / "elements"


def test_an_answer_is_kept_under_words_of_its_address_and_a_digest_that_tells_addresses_apart() -> None:
    folder = Path("kept")
    one = kept_file(ADDRESS, folder)
    assert one.parent == folder
    assert one.name.startswith("celestrak.org_NORAD_elements_gp.php_GROUP=active_FORMAT=tle-")
    assert one.suffix == ".elements"
    assert len(one.stem.rsplit("-", 1)[1]) == 8
    assert kept_file(ADDRESS, folder) == one
    assert kept_file(ADDRESS.replace("&", "+"), folder) != one
    long = kept_file("https://x.org/" + "a" * 500, folder).name
    assert len(long) == 120 + 1 + 8 + len(".elements")
    for wrong in ("ftp://x.org/a", "https:///a", "elements.tle"):
        with pytest.raises(ValueError, match="must be an address such as"):
            kept_file(wrong, folder)


def test_an_address_stands_for_the_file_that_keeps_its_answer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(ValueError, match="has not been fetched: run fetch_elements"):
        element_files(ADDRESS)
    kept = kept_file(ADDRESS, cache_folder())
    kept.parent.mkdir(parents=True)
    kept.write_text("elements")
    assert element_files(ADDRESS) == [kept]
    # The cache is itself a folder of elements.
    assert element_files(str(cache_folder())) == [kept]


def test_of_a_folder_the_files_of_elements_count_in_the_order_of_their_names(tmp_path: Path) -> None:
    for name in ("b.TLE", "a.json", ".hidden.tle", "notes.md", "c.oem"):
        (tmp_path / name).write_text("x")
    (tmp_path / "d.tle").mkdir()
    assert [path.name for path in element_files(str(tmp_path))] == ["a.json", "b.TLE", "c.oem"]
    assert element_files(str(tmp_path / "notes.md")) == [tmp_path / "notes.md"]


def test_the_version_of_elements_changes_with_their_files_and_there_is_none_without_them(tmp_path: Path) -> None:
    path = tmp_path / "a.tle"
    assert version_of("") == version_of(str(path)) == version_of(str(tmp_path)) == ()
    path.write_text("x")
    os.utime(path, ns=(5, 7))
    assert version_of(str(path)) == version_of(str(tmp_path)) == ((str(path), 7, 1),)
    path.write_text("xyz")
    os.utime(path, ns=(5, 7))
    assert version_of(str(path)) == ((str(path), 7, 3),)
    (tmp_path / "b.tle").write_text("x")
    assert [Path(name).name for name, *_ in version_of(str(tmp_path))] == ["a.tle", "b.tle"]

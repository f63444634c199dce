from dataclasses import replace

import pytest

from rf_pointing.calibration import ModelStore, ModelVersion, fit_bias_model


@pytest.fixture
def file(campaign, table_1):
    return ModelVersion.from_fit(fit_bias_model(campaign(table_1)), name="a", software="test", created_t_s=1.7e9)


@pytest.fixture
def store(tmp_path, file):
    store = ModelStore(tmp_path / "models", "gs1", "S")
    for name in "abc":
        store.add(replace(file, name=name))
    return store


def test_nothing_is_active_before_the_first_is_accepted(store):
    assert store.active() is None
    assert store.names() == ("a", "b", "c")
    with pytest.raises(ValueError, match="accepted models=0 must be >= 2"):
        store.roll_back()


def test_accept_and_roll_back_survive_a_restart(store):
    for name in ("a", "c", "b", "b"):
        store.accept(name, 1.8e9)
    again = ModelStore(store.folder, "gs1", "S")
    assert again.active().name == "b"
    assert again.roll_back().name == "c"
    assert ModelStore(store.folder, "gs1", "S").active().name == "c"


def test_a_model_of_another_station_a_taken_and_an_unknown_name_are_refused(store, file):
    with pytest.raises(ValueError, match="is of station 'gs2', must be of 'gs1'"):
        store.add(replace(file, station="gs2", name="d"))
    with pytest.raises(ValueError, match="name='a' is taken"):
        store.add(file)
    with pytest.raises(ValueError, match="name='z' must be one of a, b, c"):
        store.accept("z", 1.8e9)


def test_a_model_that_is_not_valid_is_not_accepted(store):
    with pytest.raises(ValueError, match="is valid from"):
        store.accept("a", 1.6e9)
    assert store.active() is None


@pytest.mark.parametrize("name", ["", ".hidden", "../d", "a/b", "a:b", "a*", 'a"b', "a|b", "a\\b", "a?", "<a>"])
def test_a_name_that_is_no_file_name_on_every_system_is_refused(store, file, name):
    with pytest.raises(ValueError, match="must be usable as a file name"):
        store.add(replace(file, name=name))
    assert store.names() == ("a", "b", "c")


def test_the_newest_accepted_version_that_is_valid_at_a_time_is_found(store, file):
    store.add(replace(file, name="short", valid_from_t_s=1.75e9, valid_until_t_s=1.76e9))
    assert store.active_at(1.8e9) is None
    for name, t_s in (("a", 1.7e9), ("b", 1.7e9), ("short", 1.755e9)):
        store.accept(name, t_s)
    assert [store.active_at(t_s).name for t_s in (1.74e9, 1.75e9, 1.76e9, 1.77e9)] == ["b", "short", "short", "b"]
    assert store.active_at(1.6e9) is None


@pytest.mark.parametrize("text", ['["a", 1]', '"a"', "{}"])
def test_a_history_is_a_list_of_names(store, text):
    (store.folder / "history.json").write_text(text)
    with pytest.raises(ValueError, match=r"history\.json must hold a list of names"):
        store.active()
    (store.folder / "history.json").write_text("[")
    with pytest.raises(ValueError, match=r"history\.json: "):
        store.active()

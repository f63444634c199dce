import pytest

from rf_pointing.array_sensors.interferometer.variant import is_published


def test_only_the_two_names_are_known() -> None:
    assert is_published("published")
    assert not is_published("corrected")
    with pytest.raises(ValueError, match="variant='exact' must be one of published, corrected"):
        is_published("exact")

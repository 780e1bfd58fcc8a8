from datetime import UTC, datetime

import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.corrections.neutron_monitor import read_neutron_monitor

NOON = datetime(2018, 5, 1, 12, tzinfo=UTC).timestamp()


def test_reads_the_export_of_the_neutron_monitor_database(tmp_path):
    path = tmp_path / "irkt.csv"
    path.write_text("#comment\nstart_date_time;RCORR_E\n2018-05-01 12:00:00;150.0\n2018-05-01 13:00:00;null\n"
                    "2018-05-01 14:00:00;160.0\n")  # fmt: skip
    monitor = read_neutron_monitor(path)
    assert monitor.at(NOON) == 150.0
    assert monitor.at(NOON + 3600) == pytest.approx(155.0)
    assert monitor.at(NOON + 7200) == 160.0
    assert monitor.at(NOON - 1) is None
    assert monitor.at(NOON + 7201) is None


def test_long_gaps_are_not_bridged(tmp_path):
    path = tmp_path / "gap.csv"
    path.write_text("2018-05-01T12:00:00Z,150\n2018-05-01T19:00:00Z,160\n")
    assert read_neutron_monitor(path).at(NOON + 3600) is None


def test_bad_rows_are_named(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_text("2018-05-01 12:00:00;150\n2018-05-01 13:00:00;-3\n2018-05-01 14:00:00;abc\n")
    with pytest.raises(InputError) as caught:
        read_neutron_monitor(path)
    assert [mistake.line for mistake in caught.value.mistakes] == [2, 3]
    path.write_text("time,rate\n")
    with pytest.raises(InputError, match="has no row of time and rate"):
        read_neutron_monitor(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_neutron_monitor(tmp_path / "missing.csv")

# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Many log files of one logger: folders, archives, files that cannot be used, files that decide for others."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from click.testing import CliRunner

from soilmoist_ros.cli.main import main
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.pipeline.logs import read_logs, skipped_text
from soilmoist_ros.sensing.moisture.site import Site

CRS1000 = "//RecordNum,Date Time(UTC),P4_mb,T1_C,RH1,N1Cts,N2Cts,N1ET_sec,N2ET_sec\n"
FINAPP = "Datetime,neutrons,integration_time(s),pressure(hPa)\n"
SITE = """\
name: Station
location: {latitude_deg: 51.4, longitude_deg: 12.6, altitude_m: 113}
corrections: {pressure: null, humidity: null}
"""


@pytest.fixture
def card(tmp_path):
    """The card of a logger: three files with records, two empty ones, one of another kind."""
    folder = tmp_path / "card"
    folder.mkdir()
    for number in range(3):
        rows = "".join(
            f"{n}, 2018/01/{8 + number:02d} {n:02d}:03:00, 1000, 9, 80, {150 + 7 * n % 11}, 70, 900, 900\n"
            for n in range(24)
        )
        (folder / f"DATA{number}.txt").write_text(CRS1000 + rows)
    for name in ("DATA3.txt", "DATA4.txt", ".hidden"):
        (folder / name).write_bytes(b"")
    (folder / "notes.md").write_text("battery changed\n")
    return folder


def test_a_folder_is_taken_and_what_is_skipped_is_listed(card):
    for given in ([card], sorted(card.glob("DATA*"))):
        skipped: list[Mistake] = []
        logs = read_logs(given, None, Site(), skipped=skipped)
        assert sum(len(log.records) for log in logs) == 72
        assert "DATA3.txt, DATA4.txt (is empty)" in skipped_text(skipped)
        assert ("notes.md" in skipped_text(skipped)) == (len(given) == 1)
    with pytest.raises(InputError, match=r"(?s)DATA3.txt: is empty.*DATA4.txt: is empty"):
        read_logs([card], None, Site())


@pytest.mark.slow
def test_map_writes_the_skipped_files_and_the_reading_into_its_results(card, tmp_path):
    site = tmp_path / "site.yaml"
    site.write_text(SITE)
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["map", str(card), "--site", str(site), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "records    72 used" in result.output
    assert "3 of the files are skipped: DATA3.txt, DATA4.txt (is empty); notes.md" in result.output
    assert "counts of  N1Cts; left out: N2Cts. Tube 1 is taken as moderated" in result.output
    summary = (out / "summary.json").read_text()
    assert '"skipped_files"' in summary
    assert "left out: N2Cts" in (out / "report.html").read_text()


def test_one_file_decides_the_order_of_day_and_month_for_the_others(tmp_path):
    for name, stamps in (("a.csv", ["05/01/2024"]), ("b.csv", ["05/13/2024", "05/14/2024"])):
        rows = "".join(f"{day} 10:{minute}0:00,170,600,1000\n" for day in stamps for minute in range(3))
        (tmp_path / name).write_text(FINAPP + rows)
    logs = read_logs([tmp_path / "a.csv", tmp_path / "b.csv"], None, Site())
    days = [f"{datetime.fromtimestamp(log.records[0].stamp_s, UTC):%Y-%m-%d}" for log in logs]
    assert days == ["2024-05-01", "2024-05-13"]
    with pytest.raises(InputError, match=r"5 January 2024 .* or 1 May 2024"):
        read_logs([tmp_path / "a.csv"], None, Site())


def test_columns_that_are_not_used_are_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("Datetime,neutrons,muons,integration_time(s)\n2024-05-01 10:00:00,170,8000,600\n")
    result = CliRunner().invoke(main, ["check", "--log", str(path)])
    assert "  not used    muons" in result.output


def test_a_file_without_a_header_continues_the_one_before(card):
    lines = (card / "DATA1.txt").read_text().splitlines(keepends=True)
    (card / "DATA1.txt").write_text("".join(lines[1:]))
    (card / "DATA2.txt").write_text("//Some,other,list,of,columns,for,nine,numbers,here\n" + "".join(lines[1:]))
    skipped: list[Mistake] = []
    logs = read_logs([card], None, Site(), skipped=skipped)
    assert [(log.path.name, len(log.records)) for log in logs] == [("DATA0.txt", 24), ("DATA1.txt", 24)]
    assert "DATA2.txt" in skipped_text(skipped)
    assert "DATA1.txt has no header: its columns are those of DATA0.txt" in logs[1].choices


@pytest.mark.slow
def test_a_position_that_cannot_be_read_is_not_replaced_without_a_word(tmp_path):
    rows = "".join(f"2024-05-01 {n:02d}:00:00,{1700 + 7 * n % 11},3600,1000,51.35,1243.0\n" for n in range(20))
    (tmp_path / "log.csv").write_text(FINAPP.strip() + ",latitude,longitude\n" + rows)
    (tmp_path / "site.yaml").write_text(SITE)
    options = ["--site", str(tmp_path / "site.yaml"), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(main, ["map", str(tmp_path / "log.csv"), *options])
    assert "The positions of 20 lines cannot be read, the first:" in result.output
    assert "'1243.0' is no longitude within 180 degrees -> as degrees_minutes it is 12.71667" in result.output

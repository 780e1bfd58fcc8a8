# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing import CovarianceKind, Fix, FixStatus, Kind, parse_nmea, read_positions
from soilmoist_ros.sensing.formats.log_values import nmea_checksum
from soilmoist_ros.sensing.gnss import NoPlace
from soilmoist_ros.sensing.position.nmea import NmeaParser

# The two sentences that every description of NMEA 0183 shows, with checksums as published.
GGA = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"
RMC = b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A"


def sentence(body: str) -> bytes:
    return f"${body}*{nmea_checksum(body.encode()):02X}".encode()


def gga(clock="100000.00", lat="5231.1000,N", lon="01324.6000,E", quality="1") -> bytes:
    return sentence(f"GNGGA,{clock},{lat},{lon},{quality},12,0.8,35.5,M,44.0,M,,")


def rmc(clock="100000.00", status="A", date="010524", lat="5231.1000,N", lon="01324.6000,E") -> bytes:
    return sentence(f"GNRMC,{clock},{status},{lat},{lon},1.944,90.0,{date},,,A")


def gst(ellipse="0.03,0.01,30.0") -> bytes:
    return sentence(f"GNGST,100000.00,0.1,{ellipse},0.02,0.03,0.05")


def stamp(text: str) -> float:
    return datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()


def parse(*lines: bytes, **settings) -> tuple[list[Fix], list[Kind]]:
    parser = NmeaParser(**settings)
    found = [*(parser.feed(line) for line in lines), parser.flush()]
    return [fix for fix in found if fix is not None], [problem.kind for problem in parser.problems]


def test_published_sentences() -> None:
    (fix,), problems = parse(GGA, RMC, reference_stamp_s=stamp("2024-03-23 12:00:00"))
    assert fix.position.latitude_deg == pytest.approx(48 + 7.038 / 60)
    assert fix.position.longitude_deg == pytest.approx(11 + 31 / 60)
    assert (fix.position.altitude_m, fix.geoid_separation_m) == (545.4, 46.9)
    assert (fix.status, fix.quality, fix.satellites, fix.hdop) == (FixStatus.FIX, 1, 8, 0.9)
    assert fix.speed_mps == pytest.approx(22.4 * 1852 / 3600)
    # The date is in the last century, before receivers of this kind existed: the reference is used.
    assert fix.stamp_s == stamp("2024-03-23 12:35:19")
    assert problems == []


def test_without_a_date_the_day_follows_the_computers_clock_and_a_date_counts_for_good() -> None:
    noon_s, day_s = stamp("2024-05-01 12:00:00"), 86_400.0
    lines = [
        *((gga(f"12000{second}"), noon_s - 3 * day_s) for second in (0, 1)),  # the clock of the last shutdown
        *((gga(f"12000{second}"), noon_s + 60.0) for second in (2, 3)),
        (rmc("120003"), noon_s + 60.0),
        *((gga(f"12000{second}"), noon_s + 7 * day_s) for second in (4, 5, 6)),
    ]
    parser = NmeaParser()
    fixes = [fix for line, now_s in lines if (fix := parser.feed(line, now_s)) is not None]
    assert [fix.stamp_s - noon_s for fix in fixes] == [-3 * day_s, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_fix_comes_without_delay_once_the_sentences_are_known() -> None:
    parser = NmeaParser()
    fixes = [parser.feed(line) for line in (rmc("100000"), gga("100000"), rmc("100001"), gga("100001"))]
    begun_s = stamp("2024-05-01 10:00:00")
    assert [fix and fix.stamp_s - begun_s for fix in (*fixes, parser.flush())] == [None, None, 0, 1, None]


def test_error_ellipse_or_deviations_in_east_and_north() -> None:
    (fix,), _ = parse(rmc(), gga(quality="4"), gst(ellipse="0.04,0.01,90.0"))
    np.testing.assert_allclose(fix.covariance_m2, np.diag([0.04**2, 0.01**2, 0.05**2]), atol=1e-12)
    assert fix.covariance_kind is CovarianceKind.KNOWN
    (fix,), _ = parse(rmc(), gga(quality="4"), gst(ellipse=",,"))
    np.testing.assert_allclose(fix.covariance_m2, np.diag([0.03**2, 0.02**2, 0.05**2]), atol=1e-12)
    assert fix.covariance_kind is CovarianceKind.DIAGONAL_KNOWN


def test_midnight_between_the_sentences() -> None:
    lines = [
        rmc("235959", date="311223"), gga("235959"), gga("000000"), gga("000001"), rmc("000001", date="010124"),
    ]  # fmt: skip
    fixes, _ = parse(*lines)
    assert [fix.stamp_s - stamp("2024-01-01 00:00:00") for fix in fixes] == [-1, 0, 1]


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (b"hello", Kind.UNREADABLE),
        (b"$", Kind.UNREADABLE),
        (GGA[:-1] + b"8", Kind.CHECKSUM),
        (GGA[:-3], Kind.CHECKSUM),
        (GGA[:30], Kind.CHECKSUM),
        (b"$" + b"A" * 5000, Kind.TOO_LONG),
        (gga(clock="256000"), Kind.NOT_A_NUMBER),
        (gga(lat="52x,N"), Kind.NOT_A_NUMBER),
        (gga(lat="5275.0,N"), Kind.NOT_A_NUMBER),
        (gga(lat="5231.1,Q"), Kind.NOT_A_NUMBER),
        (rmc(date="320124"), Kind.NOT_A_NUMBER),
    ],
)
def test_damaged_sentences(line, kind) -> None:
    fixes, problems = parse(line, rmc())
    assert problems == [kind]
    assert len(fixes) == 1


def test_other_sentences_empty_lines_and_a_broken_sentence_before_a_whole_one_are_no_problem() -> None:
    bodies = ("GPGSV,1,1,00", "GNVTG,90.0,T,,M,1.9,N,3.6,K,A", "PUBX,03,1", "GNXYZ,1")
    for lines in ([*map(sentence, bodies), b"\r\n", rmc()], [b"$GNRMC,1000" + rmc()]):
        fixes, problems = parse(*lines)
        assert (len(fixes), problems) == (1, [])


@pytest.mark.slow
@settings(deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["GGA", "RMC", "GST"]),
            st.lists(
                st.sampled_from(
                    ["", "1", "A", "N", "1e9", "-5", "100000", "9999.9", "nan", "010524", "x", "240000"]
                ),
                max_size=16,
            ),
        ),
        max_size=8,
    )
)
def test_any_fields_never_raise(rows) -> None:
    fixes, _ = parse(*(sentence(f"GP{kind},{','.join(fields)}") for kind, fields in rows))
    for fix in fixes:
        assert math.isnan(fix.position.latitude_deg) == (fix.status is FixStatus.NO_FIX)


@pytest.mark.parametrize(
    ("lines", "reason", "said"),
    [
        ([rmc(), gga(quality="0")], NoPlace.NO_FIX, "GGA quality 0"),
        ([rmc(), gga(quality="7")], NoPlace.TYPED_IN, "GGA quality 7"),
        ([rmc(), gga(quality="12")], NoPlace.QUALITY_UNKNOWN, "GGA quality 12"),
        ([rmc(status="V"), gga()], NoPlace.NO_FIX, "RMC status V"),
        (
            [rmc(lat="0000.0,N", lon="00000.0,E"), gga(lat="0000.0,N", lon="00000.0,E")],
            NoPlace.NO_COORDINATES,
            "GGA quality 1",
        ),
    ],
)
def test_an_epoch_without_a_place_says_why(lines, reason, said) -> None:
    (fix,), _ = parse(*lines)
    assert (fix.no_place, fix.said) == (reason, said)


@pytest.mark.parametrize("first", [True, False])
def test_another_sentence_has_the_date(first) -> None:
    dated = sentence("GNZDA,100000.00,01,05,2024,00,00")
    fixes, _ = parse(*([dated, gga()] if first else [gga(), dated]), gga("100000.50"))
    assert fixes[0].stamp_s == stamp("2024-05-01 10:00:00")


@pytest.mark.parametrize(
    ("body", "status", "quality"),
    [
        ("GNGNS,100000.00,5231.1000,N,01324.6000,E,AD,12,0.8,35.5,44.0,,", FixStatus.SBAS, 2),
        ("GNGNS,100000.00,5231.1000,N,01324.6000,E,RR,12,0.8,35.5,44.0,,", FixStatus.RTK, 4),
        ("GPGLL,5231.1000,N,01324.6000,E,100000.00,A,A", FixStatus.FIX, 1),
    ],
    ids=["GNS", "GNS RTK", "GLL"],
)
def test_other_sentences_have_the_place(body, status, quality) -> None:
    (fix,), problems = parse(sentence(body), sentence("GNZDA,100000.00,01,05,2024,00,00"))
    assert (fix.status, fix.quality, fix.stamp_s) == (status, quality, stamp("2024-05-01 10:00:00"))
    assert fix.position.latitude_deg == pytest.approx(52.5183333)
    assert fix.position.longitude_deg == pytest.approx(13.41)
    assert problems == []


EPOCHS = [(gga(f"1000{second:02d}"), rmc(f"1000{second:02d}")) for second in range(4)]
UBX = b"\xb5b\x01\x07\x5c\x00" + bytes(range(0, 250, 3))
FORMS = {
    "binary messages between": lambda one: UBX + one + b"\r\n" + UBX,
    "NovAtel between": lambda one: (
        b"#BESTPOSA,COM1,0,90.5,FINESTEERING,2312,208818.0,0,b1f6,3;SOL*1a2b3c4d\r\n" + one
    ),
    "a logger's time before": lambda one: b"2024-05-01 10:00:07.123 [rx] " + one,
    "quotes": lambda one: b"sentence: '" + one + b"'",
    "lower case": lambda one: one[:-2] + one[-2:].lower(),
    "two lines": lambda one: one[:25] + b"\r\n" + one[25:],
    "no line ends": lambda one: one,
    "no checksums": lambda one: one[:-3],
}


@pytest.mark.parametrize("form", FORMS)
def test_sentences_in_files_of_other_programs(tmp_path, form) -> None:
    glue = b"" if form == "no line ends" else b"\r\n"
    path = tmp_path / "a.log"
    path.write_bytes(glue.join(FORMS[form](one) for pair in EPOCHS for one in pair) + glue)
    fixes, problems = read_positions(path)
    assert [fix.stamp_s - stamp("2024-05-01 10:00:00") for fix in fixes] == [0, 1, 2, 3]
    assert {fix.quality for fix in fixes} == {1}
    assert [str(one.mistake.message) for one in problems] == (
        ["no sentence has a checksum: damaged ones are not noticed"] if form == "no checksums" else []
    )


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (UBX * 9, "u-blox"),
        (b"$@" + UBX[2:] * 9, "Septentrio"),
        (b"#BESTPOSA,COM1,0,90.5,FINESTEERING,2312,1.0,0,b1f6,3;SOL*1a2b3c4d\r\n", "NovAtel"),
        (b'{"class":"TPV","mode":3}\n', "gpspipe -r"),
        (bytes(range(128, 255)), "unknown kind"),
    ],
)
def test_files_of_other_protocols_are_named(tmp_path, data, what) -> None:
    path = tmp_path / "a.log"
    path.write_bytes(data)
    with pytest.raises(InputError, match=what):
        read_positions(path)


def test_without_a_date_the_day_is_that_of_the_log_or_asked_for(tmp_path) -> None:
    lines = [gga("235958"), gga("235959"), gga("000000"), gga("000001")]
    log_s = stamp("2024-05-01 23:30:00"), stamp("2024-05-02 00:30:00")
    fixes, problems = parse_nmea(lines, tmp_path, log_s)
    assert [fix.stamp_s - stamp("2024-05-02 00:00:00") for fix in fixes] == [-2, -1, 0, 1]
    kept = [problem for problem in problems if not problem.lost]
    assert [problem.kind for problem in kept] == [Kind.ASSUMED_TIME]
    assert "the day is that of the log, 2024-05-01" in str(kept[0])
    with pytest.raises(InputError, match="several of its days fit -> let the receiver send RMC"):
        parse_nmea(lines, tmp_path, (log_s[0], log_s[1] + 2 * 86_400.0))
    with pytest.raises(InputError, match=r"positions, but no date .* no record at these times of day"):
        parse_nmea(lines, tmp_path, (stamp("2024-05-01 10:00:00"), stamp("2024-05-01 11:00:00")))
    before = [b"2024/05/03 01:59:50 " + line for line in lines]  # a logger in local time
    fixes, _ = parse_nmea(before, tmp_path)
    assert [fix.stamp_s - stamp("2024-05-03 00:00:00") for fix in fixes] == [-2, -1, 0, 1]

"""``soilmoist check``: what files mean, mistakes in them, contradictions between them."""

from __future__ import annotations

from click.testing import CliRunner

from soilmoist_ros.cli.main import main


def check(*options):
    return CliRunner().invoke(main, ["check", *map(str, options)])


def test_the_command_prints_what_it_understood(roving_record):
    result = check("--site", "gypsum_transect", "--log", roving_record)
    assert result.exit_code == 0, result.output
    assert result.output.count("ok: ") == 2
    assert "  time        2018-05-01 14:14" in result.output


def test_the_command_refuses_contradictions_and_options_that_do_not_fit(roving_record):
    result = check("--site", "gypsum_transect", "--log", roving_record, "--field", "example")
    assert result.exit_code == 2
    assert "all 200 records lie 7,079 km north-west" in result.output
    assert check("--nmea", roving_record, "--site", "example").exit_code == 2
    assert check("--log", roving_record, "--site", "example", "--site", "gypsum_transect").exit_code == 2
    assert check().exit_code == 2

"""Damage to a campaign is seen, and mended where it can be."""

import pyarrow.parquet as pq
import pytest

import elevon
from elevon.campaign import load_run
from elevon.campaign.dataset import Part, Table
from elevon.errors import FormatError, InputError
from tests.campaign.make import whole


def flip(path, place):
    data = bytearray(path.read_bytes())
    data[place % len(data)] ^= 1 << (place % 8)
    path.write_bytes(data)


def test_one_flipped_bit_is_seen_and_mended(plan, cli, tmp_path):
    path, out = plan(), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    block = out / "runs" / "at_400_hz" / "block_00001.parquet"
    good = block.read_bytes()
    for place in range(7, len(good), len(good) // 12):
        flip(block, place)
        with pytest.raises(FormatError, match="not as it was written"):
            load_run(out, 5)
        block.write_bytes(good)
    flip(block, len(good) // 2)
    code, summary, _ = cli("campaign", "run", path, "--out", out)
    assert (code, summary["skipped"]) == (0, 8)
    assert block.read_bytes() == good
    whole(out, 12)


def test_pages_carry_checksums(plan, cli, tmp_path):
    path, out = plan(4, head=""), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    ds = elevon.load_campaign(out)
    block = ds.signals.files[0]
    good = block.read_bytes()
    values = ds.signals.to_arrow()
    bare = Table(ds.signals.path, [Part(block, 0, 3, None)])  # nobody knows its SHA-256
    refused = 0
    footer = int.from_bytes(good[-8:-4], "little") + 8
    for place in range(4, len(good) - footer, 37):
        flip(block, place)
        try:
            assert bare.to_arrow().equals(values), place
        except FormatError:
            refused += 1
        block.write_bytes(good)
    assert refused > 10


@pytest.mark.parametrize("name", ["manifest.json", "resolved.json", "runs.parquet"])
def test_damage_to_what_a_folder_says_of_itself(plan, cli, tmp_path, name):
    path, out = plan(), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    text = (out / name).read_bytes()
    flip(out / name, len(text) // 2)
    with pytest.raises(InputError):
        elevon.load_campaign(out).resolved()


@pytest.mark.parametrize("name", ["resolved.json", "runs.parquet", "plan.toml"])
def test_a_damaged_table_of_a_finished_campaign_is_mended(plan, cli, tmp_path, name):
    path, out = plan(4, head="runs_per_file = 2"), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    good = (out / name).read_bytes()
    flip(out / name, (out / name).stat().st_size // 2)
    assert cli("dataset", "verify", out)[0] == 1
    code, report, _ = cli("campaign", "run", path, "--out", out)
    assert (code, report["skipped"]) == (0, 4)  # nothing is simulated again
    assert cli("dataset", "verify", out)[0] == 0
    assert (out / name).read_bytes() == good


@pytest.mark.parametrize("place", ["page", "statistics"])
def test_a_damaged_table_and_a_damaged_block(place, plan, cli, tmp_path):
    """A block that is not the one that the manifest states is simulated, nothing else.

    No checksum of a page covers the statistics: a flipped minimum leaves a file that reads well.
    """
    path, out = plan(6, head="runs_per_file = 2"), tmp_path / "out"
    cli("campaign", "run", path, "--out", out)
    flip(out / "runs.parquet", (out / "runs.parquet").stat().st_size // 2)
    block = out / "ends" / "block_00001.parquet"
    column = pq.ParquetFile(block).metadata.row_group(0).column(0)
    if place == "page":
        flip(block, column.data_page_offset + column.total_compressed_size - 1)
    else:
        least = column.statistics.min.to_bytes(8, "little")
        flip(block, block.read_bytes().rindex(least))
        assert pq.read_table(block).num_rows == 2
    code, report, _ = cli("campaign", "run", path, "--out", out)
    assert (code, report["skipped"]) == (0, 4)
    assert cli("dataset", "verify", out)[0] == 0

"""The same plan on a cluster gives the same bytes."""

import hashlib

import pytest

from elevon.campaign import read_manifest
from elevon.campaign.cluster import worker_block
from elevon.errors import InputError


def marks(folder):
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*.parquet")
    }


@pytest.mark.long
def test_a_cluster_gives_the_same_bytes(plan, cli, tmp_path):
    path = plan(24, head="runs_per_file = 2")  # more blocks than are given out ahead
    assert cli("campaign", "run", path, "--out", tmp_path / "one")[0] == 0
    arguments = ("campaign", "run", path, "--out", tmp_path / "many", "--cluster", "local:2")
    code, report, _ = cli(*arguments)
    assert (code, report["runs"], report["status"]) == (0, 24, "ok")
    assert marks(tmp_path / "one") == marks(tmp_path / "many")
    assert cli("dataset", "verify", tmp_path / "many")[0] == 0


def test_a_worker_does_its_block_from_the_folder_alone(plan, cli, tmp_path):
    out = tmp_path / "out"
    assert cli("campaign", "run", plan(), "--out", out)[0] == 0
    manifest, before = read_manifest(out), marks(out)
    (out / "runs" / "at_400_hz" / "block_00001.parquet").unlink()
    item = worker_block(str(out), manifest.core, 1, 4, 8)
    assert marks(out) == before
    assert item.files == manifest.blocks[1]["files"]
    with pytest.raises(InputError, match="another build"):
        worker_block(str(out), "other", 1, 4, 8)


@pytest.mark.parametrize("cluster", ["local:0", "local:9999"])
def test_clusters_that_cannot_be(plan, cli, tmp_path, cluster):
    code, _, err = cli("campaign", "run", plan(), "--out", tmp_path / "out", "--cluster", cluster)
    assert code == 2
    assert "outside 1 to 1024" in err


def test_a_cluster_or_a_scheduler(plan, cli, tmp_path):
    both = ("--cluster", "local:2", "--scheduler", "tcp://a:1")
    code, _, err = cli("campaign", "run", plan(), "--out", tmp_path / "out", *both)
    assert code == 2
    assert "either --scheduler or --cluster" in err

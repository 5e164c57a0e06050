"""A chart of some scenes keeps what is known of the others."""

from __future__ import annotations

from radiosity.benchmarks.chart import with_others

HEAD = "scene,program,seconds"


def test_scenes_that_were_not_measured_keep_their_rows(tmp_path):
    table = tmp_path / "accuracy.csv"
    table.write_text(f"{HEAD}\ncornell,ours,5\npandora,ours,80\npandora,cycles,82\n")
    assert with_others(["truck_town,ours,6", "cornell,ours,4"], HEAD, table) == [
        HEAD, "cornell,ours,4", "truck_town,ours,6", "pandora,ours,80", "pandora,cycles,82"]


def test_a_table_of_other_columns_is_not_kept(tmp_path):
    table = tmp_path / "accuracy.csv"
    assert with_others(["cornell,ours,4"], HEAD, table) == [HEAD, "cornell,ours,4"]
    table.write_text("scene,seconds\npandora,80\n")
    assert with_others(["cornell,ours,4"], HEAD, table) == [HEAD, "cornell,ours,4"]

"""The Python of README.md and docs/: it runs, one block after the other, and does what the page says."""

import re

import numpy as np
import pages
import pytest

EVERY_BLOCK = [
    pytest.param(page.name, block, id=f"{page.relative_to(pages.ROOT)}, block {number}")
    for page in pages.pages()
    for number, block in enumerate(pages.blocks(page.read_text(), "python"), start=1)
]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Runs the blocks of a page in an empty folder, all or those that hold a text; returns the names they leave."""
    monkeypatch.chdir(tmp_path)

    def blocks_of(page, holding=""):
        names = {}
        for block in pages.blocks((pages.ROOT / page).read_text(), "python"):
            if holding in block:
                exec(block, names)
        return names

    return blocks_of


@pytest.mark.parametrize(("page", "block"), EVERY_BLOCK)
def test_it_is_python(page, block):
    compile(block, page, "exec")


def test_readme(run, tmp_path, capsys):
    names = run("README.md")
    assert "person" in capsys.readouterr().out
    assert (tmp_path / "frame.label").stat().st_size == 4 * len(names["points"])
    person = names["result"].labels[len(names["wall"]) :]
    assert (person == 1).mean() > 0.95
    assert np.isin(names["result"].labels[: len(names["wall"])], [-1, 0]).mean() > 0.9
    np.testing.assert_allclose(names["found"].box.size, [0.6, 0.3, 1.8], atol=0.1)


def test_masks(run, capsys):
    names = run("docs/masks.md")
    assert capsys.readouterr().out == "['car', 'person']\n"
    assert [mask.area for mask in names["masks"]] == [20_000, 16_000]
    assert len(names["boxes"]) == 1
    assert [mask.name for mask in names["cars_and_people"]] == ["person", "car", "car"]


def test_rings(run, capsys):
    names = run("docs/rings.md")
    result = names["result"]
    assert result.sources == (((0, 0), (1, 0)),)
    # its lowest row in ten is where the ground is taken to be
    assert (result.labels[: len(names["car"])] == 1).mean() >= 0.9
    assert "left" in capsys.readouterr().out


def test_quick_start(own_demo, run, tmp_path, capsys):
    names = run("docs/quick-start.md")
    assert "15 of 15 objects found" in capsys.readouterr().out
    assert (tmp_path / "street.ply").stat().st_size > 12 * len(names["points"])


def test_errors(run, tmp_path, capsys):
    (tmp_path / "000571.bin").write_bytes(b"cut")
    names = run("docs/errors.md")
    error, report = capsys.readouterr().out.splitlines()
    assert error.startswith("truncated_file 000571.bin: 3 bytes")
    assert f"prints `{report}`" in (pages.ROOT / "docs/errors.md").read_text()
    assert names["report"].n_points == 5


def test_poses_from_memory(run, capsys):
    run("docs/datasets.md", holding="Trajectory")
    printed = capsys.readouterr().out.strip()
    assert f"prints `{printed}`" in (pages.ROOT / "docs/datasets.md").read_text()


def test_simulation(run):
    pytest.importorskip("embreex")
    names = run("docs/simulation.md", holding="scene_frame")
    assert len(names["result"].labels) == len(names["frame"].truth.instances)


def test_from_a_bag_to_a_labelled_bag(run):
    pytest.importorskip("rosbags")
    pytest.importorskip("embreex")
    from ldls.datasets import RosBag
    from ldls.simulation import write_robot_drive

    write_robot_drive("robot", "mcap", frames=2)
    names = run("docs/ros.md", holding="import ldls")
    labelled = RosBag("robot/labelled")  # its labelled clouds alone
    assert len(labelled) == 2
    np.testing.assert_array_equal(labelled.cloud(1).fields["class_id"], names["result"].categories)


def test_motion_within_a_sweep(run, capsys):
    run("docs/drives.md", holding="deskew")
    printed = capsys.readouterr().out.strip()
    assert f"prints `{printed}`" in (pages.ROOT / "docs/drives.md").read_text()


def test_ci_runs_the_test_command_of_the_readme():
    command = "pip install '.[test]' && pytest"
    assert command in (pages.ROOT / "README.md").read_text()
    # in a group of its own, which fails where the install does
    assert f"\n({command})\n" in (pages.ROOT / ".ci/run").read_text()


def test_viewing(run, own_demo, tmp_path, monkeypatch):
    (tmp_path / "ldls-demo").rename(tmp_path / "street")
    monkeypatch.setattr("PIL.Image.Image.show", lambda picture: None)
    run("docs/viewing.md")
    assert {path.name for path in tmp_path.glob("street*.png")} == {
        "street.png", "street-birds-eye.png", "street-comparison.png",
    }  # fmt: skip


def test_rerun(run, own_demo, tmp_path):
    rerun = pytest.importorskip("rerun")
    from ldls.viewing import recording

    (tmp_path / "ldls-demo").rename(tmp_path / "street")
    run("docs/rerun.md")
    rerun.set_global_data_recording(None)
    assert all((tmp_path / name).stat().st_size > 100_000 for name in ("street.rrd", "robot.rrd"))
    rows = re.findall(r"^\| `((?:world|diffusion)\S*)` \|", (pages.ROOT / "docs/rerun.md").read_text(), re.MULTILINE)
    assert rows == re.findall(r"^(?:world|diffusion)\S*", recording.__doc__, re.MULTILINE)

"""Runs with one file of all masks, and with the masks that a source names itself."""

import json
import shutil

import numpy as np
import pytest
from PIL import Image

import ldls
from batch import runs
from command import command
from datasets import layouts
from ldls import batch
from ldls.errors import BatchError, InputError, ParameterError
from ldls.io.masks import data_set as data_set_module


def gather(source, path, names="{}.png", frames=None):
    """One file of the masks of all frames, each image under a name made of its frame's."""
    files = sorted((source / "masks").glob("*.json"))[:frames]
    documents = [json.loads(file.read_text()) for file in files]
    images = [
        document["images"][0] | {"id": k, "file_name": names.format(file.stem)}
        for k, (file, document) in enumerate(zip(files, documents, strict=True))
    ]
    annotations = [a | {"image_id": k} for k, document in enumerate(documents) for a in document["annotations"]]
    content = {"images": images, "categories": documents[0]["categories"], "annotations": annotations}
    path.write_text(json.dumps(content))
    return path


def run(source, out, masks=None, **options):
    return batch.run(source, out, batch.RunSettings(masks=None if masks is None else str(masks)), **options)


def labels(out):
    return {name: content for name, content in runs.contents(out).items() if name.endswith(".label")}


def test_one_file_yields_the_results_of_a_file_for_each_frame(source, undisturbed, tmp_path, monkeypatch):
    path = gather(source, tmp_path / "instances.json", "image_2/{}.jpg")
    opened = []
    open_file = data_set_module.open_file
    monkeypatch.setattr(
        data_set_module,
        "open_file",
        lambda path, *more, **options: opened.append(path) or open_file(path, *more, **options),
    )
    assert run(source, tmp_path / "out", path).n_done == 60
    assert labels(tmp_path / "out") == {name: each for name, each in undisturbed.items() if name.endswith(".label")}
    assert opened == [path]
    header, *frames = (tmp_path / "out/journal.jsonl").read_text().splitlines()
    assert len(json.loads(header)["settings"]["masks_sha256"]) == 64
    assert not any("instances.json" in line for line in frames)


def test_a_frame_that_is_not_in_the_file_fails_and_one_without_annotations_does_not(few, tmp_path):
    path = gather(few, tmp_path / "instances.json", frames=11)
    content = json.loads(path.read_text())
    content["annotations"] = [a for a in content["annotations"] if a["image_id"] != 4]
    path.write_text(json.dumps(content))
    summary = run(few, tmp_path / "out", path)
    (failure,) = summary.failures
    assert (failure.frame, failure.stage) == ("000011", "masks")
    assert "has no 000011, the image of camera image_2 in frame 000011" in failure.message
    assert set((tmp_path / "out/000004.label").read_bytes()) == {0}
    assert set((tmp_path / "out/000003.label").read_bytes()) != {0}


def test_a_file_of_other_images_stops_the_run_at_once(few, tmp_path):
    path = gather(few, tmp_path / "instances.json", "frame {}.png")
    outcome = command("run", few, "--masks", path, "--out", tmp_path / "out")
    assert outcome.exit_code == 1
    assert "it has 'frame 000000.png', 'frame 000001.png', 'frame 000002.png' and 9 more" in outcome.output
    assert "the frames are '000000', '000001', '000002' and 9 more" in outcome.output
    assert not (tmp_path / "out/journal.jsonl").exists()


def test_a_file_of_masks_that_was_changed_since_is_refused(few, tmp_path):
    path = gather(few, tmp_path / "instances.json")
    run(few, tmp_path / "out", path)
    assert run(few, tmp_path / "out", path).n_earlier == 12
    path.write_text(path.read_text() + "\n")
    with pytest.raises(BatchError, match="settings.masks_sha256 was '[0-9a-f]{64}', is '[0-9a-f]{64}'"):
        run(few, tmp_path / "out", path)


@pytest.fixture
def folder(tmp_path):
    """A folder of two frames whose ldls.toml names masks, and those masks."""
    made = layouts.plain_folder(tmp_path / "rig", layouts.FOLDER_TOML.replace(".npz", ".json"))
    for left, name in enumerate("ab", start=20):
        layouts.write_text(made / f"masks/{name}.json", json.dumps(layouts.coco(left)))
    return made


def test_masks_that_the_source_names_are_used_and_said(folder, tmp_path):
    outcome = command("run", folder, "--out", tmp_path / "own")
    assert outcome.exit_code == 0, outcome.output
    assert f"masks are those that {folder} names (front: masks/{{frame}}.json)" in outcome.output
    outcome = command("run", folder, "--masks", f"{folder}/masks/{{frame}}.json", "--out", tmp_path / "given")
    assert outcome.exit_code == 0 and "masks are those" not in outcome.output
    assert labels(tmp_path / "own") == labels(tmp_path / "given") != {}
    assert any(set(content) != {0} for content in labels(tmp_path / "own").values())


def test_given_masks_win_over_those_of_the_source(folder, tmp_path):
    for name in "ab":
        layouts.write_text(tmp_path / f"others/{name}.json", json.dumps(layouts.coco(45)))
    run(folder, tmp_path / "own")
    run(folder, tmp_path / "given", tmp_path / "others")
    assert labels(tmp_path / "own") != labels(tmp_path / "given")


def test_a_changed_file_of_the_source_s_masks_is_refused(folder, tmp_path):
    run(folder, tmp_path / "out")
    layouts.write_text(folder / "masks/b.json", json.dumps(layouts.coco(45)))
    with pytest.raises(BatchError, match=r"masks/b\.json, of which frame b was made, was changed since"):
        run(folder, tmp_path / "out")


@pytest.mark.parametrize("given", [False, True], ids=["of the source", "given"])
@pytest.mark.parametrize("change", ["another", "one more", "one less"])
def test_masks_that_are_a_folder_of_pictures(folder, tmp_path, given, change):
    """As Segment Anything's script writes them, one picture an instance."""
    for name in "ab":
        masks = ldls.read_masks(folder / f"masks/{name}.json")
        (folder / f"masks/{name}").mkdir()
        for number, mask in enumerate(masks.to_array()):
            Image.fromarray(mask.astype(np.uint8) * 255).save(folder / f"masks/{name}/{number}.png")
    text = (folder / "ldls.toml").read_text()
    layouts.write_text(folder / "ldls.toml", text.replace("masks/{frame}.json", "masks/{frame}"))
    place = f"{folder}/masks/{{frame}}" if given else None
    assert run(folder, tmp_path / "out", place).n_done == 2
    (folder / "masks/b/.DS_Store").touch()
    (folder / "masks/b/._0.png").write_bytes(b"of a file manager")
    assert run(folder, tmp_path / "out", place).n_earlier == 2
    first = folder / "masks/b/0.png"
    if change == "another":
        Image.fromarray(255 - np.asarray(Image.open(first))).save(first)
    elif change == "one more":
        shutil.copy(first, first.with_stem("7"))
    else:
        first.unlink()
    with pytest.raises(BatchError, match="masks/b, of which frame b was made, was changed since"):
        run(folder, tmp_path / "out", place)


def test_a_frame_whose_masks_the_source_names_and_does_not_have_fails(folder, tmp_path):
    (folder / "masks/b.json").unlink()
    (failure,) = run(folder, tmp_path / "out").failures
    assert (failure.frame, failure.stage) == ("b", "masks")
    assert failure.message == "camera front: no masks at 'masks/{frame}.json' of the source"


def test_cameras_for_which_the_source_names_no_masks_are_left_out(folder, tmp_path):
    run(folder, tmp_path / "one")
    description = (folder / "ldls.toml").read_text()
    front = description[description.index("[cameras.front]") :]
    back = front.replace("front", "back").replace('masks = "masks/{frame}.json"\n', "")
    layouts.write_text(folder / "ldls.toml", description + back)
    for name in "ab":
        layouts.write_image(folder / f"back/{name}.png")
    run(folder, tmp_path / "two")
    assert labels(tmp_path / "one") == labels(tmp_path / "two")


def one_file(few):
    return few, {"masks": str(gather(few, few / "instances.json"))}


def boxes_of_each_frame(few):
    return few, {"segmenter": f"boxes:{few}/label_2/{{frame}}.txt"}


def network(few):
    pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")
    from segmenters import graphs

    one = np.ones((1, 4), np.float32)
    model = graphs.constant_detections(one, np.array([3]), one[0, :1], np.ones((1, 1, 9, 9), np.float32))
    return few, {"segmenter": f"onnx:{graphs.save(model, few / 'model.onnx')}"}


def one_file_of_the_source(few):
    folder = layouts.plain_folder(few / "rig", layouts.FOLDER_TOML.replace("masks/{frame}.npz", "all.json"))
    gather(few, folder / "all.json", "{}.png", frames=2)
    for number, name in enumerate("ab"):
        text = (folder / "all.json").read_text().replace(f"{number:06d}.png", f"{name}.png")
        layouts.write_text(folder / "all.json", text)
    return folder, {}


@pytest.mark.parametrize("masks", [one_file, boxes_of_each_frame, network, one_file_of_the_source])
def test_a_category_that_masks_cannot_have_is_refused_before_the_first_frame(few, tmp_path, masks):
    source, settings = masks(few)
    with pytest.raises(ParameterError, match=r"categories: 'persn' is unknown; did you mean 'person'"):
        batch.run(source, tmp_path / "out", batch.RunSettings(categories=("car", "persn"), **settings))
    assert list((tmp_path / "out").iterdir()) == []
    words = [f"--{name}={value}" for name, value in settings.items()]
    shown = command("view", source, *words, "--categories=persn", "--rerun", "a.rrd")
    assert shown.exit_code == 1
    assert shown.stderr.endswith("error: --categories: 'persn' is unknown; did you mean 'person'?\n")


def test_a_place_without_masks(few, tmp_path):
    with pytest.raises(InputError, match="there is no"):
        run(few, tmp_path / "out", tmp_path / "none")

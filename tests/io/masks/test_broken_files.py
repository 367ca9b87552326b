"""Files of masks with bytes changed, lost or added: an error that names the file, or masks, and never anything else."""

import random

import numpy as np
import pytest
from PIL import Image

import ldls
from mask_samples import random_masks

LINES = """Car 0.00 0 1.85 3.1 2.2 9.5 8.0 1.67 1.87 3.69 -16.53 2.39 58.49 1.57
Pedestrian 0.00 0 1.85 0 0 5 5 1.67 1.87 3.69 -16.53 2.39 58.49 1.57 0.5
"""


def write_numbers(path, masks):
    Image.fromarray(masks.to_instance_image()).save(path)


WRITERS = {
    "masks.json": lambda path, masks: ldls.save(masks, path),
    "masks.png": lambda path, masks: ldls.save(masks, path),
    "numbers.png": write_numbers,
    "masks.npz": lambda path, masks: ldls.save(masks, path),
    "masks.npy": lambda path, masks: ldls.save(masks, path, pixels_only=True),
    "boxes.txt": lambda path, masks: path.write_text(LINES),
}
WITH_CHECKSUMS = {"masks.png", "numbers.png", "masks.npz"}


def mutated(content, generator):
    content = bytearray(content)
    for _ in range(generator.choice([1, 1, 1, 4, 12])):
        at, length = generator.randrange(len(content) + 1), generator.choice([1, 2, 40])
        how = generator.choice(["change", "change", "cut out", "insert", "cut off"])
        if how == "change":
            content[at : at + 1] = generator.randbytes(1)
        elif how == "cut out":
            del content[at : at + length]
        elif how == "insert":
            content[at:at] = generator.randbytes(length)
        else:
            del content[at:]
    return bytes(content)


@pytest.mark.parametrize("name", WRITERS)
def test_changed_bytes_are_named_errors(tmp_path, name):
    masks = random_masks(3).resolve_overlaps()
    path = tmp_path / name
    WRITERS[name](path, masks)
    whole, intact = path.read_bytes(), ldls.read_masks(path, image_size=masks.image_size)
    generator = random.Random(name)
    for _ in range(400):
        path.write_bytes(mutated(whole, generator))
        try:
            found = ldls.read_masks(path, image_size=masks.image_size)
        except ldls.LdlsError as error:
            assert name in str(error)
        else:
            if name in WITH_CHECKSUMS:
                assert found == intact
            assert np.isfinite(found.scores).all()

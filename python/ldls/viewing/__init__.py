"""Pictures of results.

    ldls.viewing.overlay(result, image)         the image with masks, points and names
    ldls.viewing.birds_eye_view(result)         the cloud from above, with oriented boxes and rings of equal range
    ldls.viewing.comparison(result, image)      direct projection beside the method, changed points marked
    ldls.viewing.save_pictures("a.png", result, image)      all three as files

Each is a `PIL.Image.Image`. Categories have the same hue in every one.
"""

from ldls.viewing.birds_eye import birds_eye_view
from ldls.viewing.comparison import comparison
from ldls.viewing.files import save_picture, save_pictures
from ldls.viewing.overlay import masks_overlay, overlay

__all__ = ["birds_eye_view", "comparison", "masks_overlay", "overlay", "save_picture", "save_pictures"]

import numpy as np

from ldls.evaluation import Labeling

NAMES = ("background", "Car", "Pedestrian")


def labeling(classes, instances=None, ignored=(), names=NAMES):
    """Labels from lists; `ignored` are indices."""
    out = np.zeros(len(classes), bool)
    out[list(ignored)] = True
    if instances is None:
        instances = np.zeros(len(classes), int)
    return Labeling(np.array(classes, int), np.array(instances, int), out, names)


def random_labeling(generator, n, n_classes=2, n_instances=3):
    classes = generator.integers(0, n_classes + 1, n)
    # an instance may be 0, and reaches over classes: (class, instance) names it
    instances = np.where(classes > 0, generator.integers(0, n_instances + 1, n), 0)
    ignored = generator.random(n) < 0.1
    names = ("background", *(f"class {k}" for k in range(1, n_classes + 1)))
    return Labeling(classes, instances, ignored, names)


def disturbed(generator, truth, share):
    """`truth` with a share of its points labelled at random: overlaps from none to all."""
    other = random_labeling(generator, len(truth), len(truth.names) - 1)
    hit = generator.random(len(truth)) < share
    return Labeling(
        np.where(hit, other.classes, truth.classes),
        np.where(hit, other.instances, truth.instances),
        other.ignored & (generator.random(len(truth)) < 0.2),
        truth.names,
    )

"""The contents of a recording, read with Rerun's own reader."""

from dataclasses import dataclass

from rerun.chunk import RrdReader


@dataclass(frozen=True)
class Row:
    """The values logged to one entity at one time; `times` is empty where it holds for all times."""

    times: dict
    values: dict


class Recorded:
    """The rows of each entity of a file, by its path without the leading slash, in the order of logging."""

    def __init__(self, path):
        reader = RrdReader(str(path))
        self.recording = reader.recordings()[0]
        self.rows = {}
        for chunk in reader.stream():
            for row_id, row in _rows(chunk):
                self.rows.setdefault(chunk.entity_path.lstrip("/"), []).append((row_id, row))
        for rows in self.rows.values():
            rows.sort(key=lambda pair: pair[0])
        sent = sorted((_views(reader, store) for store in reader.blueprints()), key=lambda views: views[0])
        self.views = [(views, timeline) for _, views, timeline in sent]

    @property
    def entities(self):
        return {path for path in self.rows if not path.startswith("__")}

    @property
    def timelines(self):
        return {name for path in self.entities for row in self.each(path) for name in row.times}

    def each(self, path, component=None):
        """The rows of an entity that have a component."""
        rows = [row for _, row in self.rows[path]]
        return [row for row in rows if component is None or component in row.values]

    def last(self, path, component):
        return self.each(path, component)[-1].values[component]

    def names(self, path):
        """{(class, keypoint or None): (name, (r, g, b))} of the context that holds in the end."""
        names = {}
        for entry in self.last(path, "AnnotationContext:context")[0].as_py():
            info = entry["class_description"]["info"]
            names[entry["class_id"], None] = (info["label"], rgb([info["color"]])[0])
            for point in entry["class_description"]["keypoint_annotations"]:
                names[entry["class_id"], point["id"]] = (point["label"], rgb([point["color"]])[0])
        return names


def rgb(packed):
    return [tuple(int(colour) >> shift & 255 for shift in (24, 16, 8)) for colour in packed]


def vectors(array, size=3):
    """(n, size) numbers of an array of fixed-size lists."""
    return array.flatten().to_numpy(zero_copy_only=False).reshape(-1, size)


def _rows(chunk):
    batch = chunk.to_record_batch()
    names = batch.schema.names
    lines = {name for name in names if name in chunk.timeline_names}
    for at in range(batch.num_rows):
        times = {name: batch.column(name).cast("int64")[at].as_py() for name in lines}
        values = {}
        for name in set(names) - lines - {"rerun.controls.RowId"}:
            scalar = batch.column(name)[at]
            if scalar.is_valid:
                values[name] = scalar.values
        yield batch.column("rerun.controls.RowId")[at].as_py(), Row(times, values)


def _views(reader, store):
    """When a blueprint was sent, the name of each of its views and where it looks, and the timeline it shows."""
    views, timeline, sent = {}, None, 0
    for chunk in reader.stream(store=store):
        for _, row in _rows(chunk):
            sent = max(sent, row.times["log_time"])
            if "ViewBlueprint:display_name" in row.values:
                name = row.values["ViewBlueprint:display_name"][0].as_py()
                views[name] = row.values["ViewBlueprint:space_origin"][0].as_py()
            if "TimePanelBlueprint:timeline" in row.values:
                timeline = row.values["TimePanelBlueprint:timeline"][0].as_py()
    return sent, views, timeline

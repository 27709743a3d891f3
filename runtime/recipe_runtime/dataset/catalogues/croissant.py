"""`croissant.json`: a description of the dataset in Croissant 1.1, which catalogues of datasets and mlcroissant read.

It has the core, the fields for responsible AI that NeurIPS requires of every dataset, and record sets that are read
from the files. The provenance names the recipe by its identity line, every plan by its digest, and every mesh and image
that the recipe uses by its SHA-256. What the recipe does not state has a text that is true of every dataset of this
project. The file follows from plan and identity, so verification writes it again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from recipe_compiler.ir.canonical import pretty
from recipe_compiler.ir.modalities import KINDS, MODALITIES, form_of
from recipe_compiler.ir.plan import DatasetPlan

from recipe_runtime.core import layout

_Json = dict[str, object]

_PLACE = r"^(?:.*/)?([^/]+)/[^/]+/{rest}$"  # of the variant's folder, in the path of a file
_SENSOR = r"^(?:.*/)?[^/]+/([^/]+)/{rest}$"
_LABELS, _TRACKS, _PICTURES = "labels", "tracks", "rgb"
_ENCODINGS = {"png": "image/png", "tif": "image/tiff"}
_MOTION = {
    **{"frame": "Integer", "time": "Float", "actor": "Text", "instance": "Integer", "present": "Integer"},
    **dict.fromkeys(("x", "y", "z", "yaw", "pitch", "roll", "vx", "vy", "vz", "length", "width", "height"), "Float"),
}
_OBJECT = {
    "actor": ("Text", "name of the actor in the recipe"),
    "instance": ("Integer", "CARLA tag * 1000 + number of the actor"),
    "bbox": ("Integer", "x, y, width, height of the visible pixels"),
    "area": ("Integer", "number of visible pixels"),
    "counts": ("Text", "mask of the visible pixels in COCO's run-length code"),
    "visible_fraction": ("Float", "share of its pixels that nothing hides"),
    "truncation": ("Float", "share of its box outside of the picture"),
    "distance": ("Float", "from the sensor to the centre of its box, metres"),
}
_CONTEXT: _Json = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "prov": "http://www.w3.org/ns/prov#",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "sc": "https://schema.org/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "description": {"@container": "@language"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "name": {"@container": "@language"},
    **{
        name: f"cr:{name}"
        for name in (
            *("arrayShape", "citeAs", "column", "containedIn", "equivalentProperty", "extract", "field", "fileObject"),
            *("fileProperty", "fileSet", "format", "includes", "isArray", "isLiveDataset", "jsonPath", "key", "md5"),
            *("parentField", "path", "recordSet", "references", "regex", "repeated", "replace", "samplingRate"),
            *("separator", "source", "subField", "transform"),
        )
    },
}


def croissant(dataset: DatasetPlan, identity: str, recipe_file: str | None = None) -> str:
    """Return the text of the file.

    Args:
        dataset: The plan of the dataset.
        identity: The dataset's identity line.
        recipe_file: The path of the recipe's pack in the dataset, if it is included.
    """
    about = dataset.about
    document: _Json = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": dataset.recipe,
        "description": dataset.description or f"The dataset of the recipe {dataset.recipe}.",
        "identifier": identity,
        "license": about.licence_url or about.licence,
        "creator": [{"@type": "sc:Person", "name": name} for name in about.authors],
        "citeAs": about.citation,
        "url": about.url,
        "version": about.version,
        **_responsible(dataset),
        **_provenance(dataset, identity, recipe_file),
        "distribution": [*_files(dataset)],
        "recordSet": [*_record_sets(dataset)],
    }
    return pretty({key: value for key, value in document.items() if value not in ("", [])})


def _responsible(dataset: DatasetPlan) -> _Json:
    """Return the fields for responsible AI: what the recipe states, else what is true of every dataset."""
    about, used = dataset.about, {digest for variant in dataset.variants for digest in variant.files}
    own = "The recipe adds meshes or images of its own, of which nothing is known here. " if used else ""
    return {
        "rai:hasSyntheticData": True,
        "rai:dataCollection": "Simulated and rendered from a recipe; no sensor recorded anything.",
        "rai:dataAnnotationProtocol": "Annotations are computed from the geometry that was rendered, by no person.",
        "rai:dataUseCases": about.uses
        or "Training and testing of detection, segmentation, depth estimation and tracking, and studies of weather, "
        "light and physical attacks. Not evidence that a system is safe in the real world.",
        "rai:dataLimitations": about.limitations
        or "Bodies, materials, light, weather and sensors are simplified models; people and vehicles move by rules. "
        "Results on these pictures do not show results on photographs.",
        "rai:dataBiases": about.biases
        or "How often people, vehicles, places, weathers and times of day occur is what the recipe chose, not what any "
        "real place has. Variants and sensors show the same scenes, so their frames are not independent.",
        "rai:personalSensitiveInformation": about.personal_information
        or f"{own}All other people, vehicles and places are generated and depict no real ones.",
        "rai:dataSocialImpact": about.social_impact
        or "Not assessed. The data can be made again and checked without the collection of pictures of real people; "
        "systems that it helps to train can be used to observe people.",
    }


def _provenance(dataset: DatasetPlan, identity: str, recipe_file: str | None) -> _Json:
    """Return what the dataset was made of, and how."""
    recipe: _Json = {"@type": "prov:Entity", "prov:label": "recipe", "identifier": f"sha256:{dataset.digest}"}
    if recipe_file is not None:
        recipe["prov:atLocation"] = recipe_file
    files = {digest: file for variant in dataset.variants for digest, file in variant.files.items()}
    plans = [
        {
            "@type": "prov:Entity",
            "prov:label": f"plan of {variant.variant}",
            "identifier": f"sha256:{variant.digest}",
            "prov:atLocation": layout.plan_file(variant.variant),
        }
        for variant in dataset.variants
    ]
    return {
        "prov:wasDerivedFrom": [
            recipe,
            *(
                {"@type": "prov:Entity", "prov:label": f"{file.kind} file", "identifier": f"sha256:{digest}"}
                for digest, file in sorted(files.items())
            ),
        ],
        "prov:wasGeneratedBy": {
            "@type": "prov:Activity",
            "prov:label": "recipe build",
            "description": f"Builds {identity} with Dataset Recipe. `recipe verify` renders frames again and compares "
            f"their bytes; {layout.MANIFEST} has the versions of all tools.",
            "prov:wasAssociatedWith": {"@type": "prov:SoftwareAgent", "prov:label": "Dataset Recipe"},
            "prov:used": plans,
        },
    }


def _files(dataset: DatasetPlan) -> Iterator[_Json]:
    """Yield the sets of files: labels, motion, and those of each modality that is captured."""
    yield _file_set(_LABELS, "*/*/labels.jsonl", "application/jsonlines", "Labels: a line for each frame of a sensor.")
    yield _file_set(_TRACKS, "*/tracks.csv", "text/csv", "Pose, velocity and box of every actor at every frame.")
    for name in _captured(dataset):
        ending = form_of(name, dataset.forms).ending
        encoding = _ENCODINGS.get(ending, "application/octet-stream")
        yield _file_set(name, f"*/*/{name}/*.{ending}", encoding, f"{name}: {KINDS[name].help}.")


def _captured(dataset: DatasetPlan) -> list[str]:
    taken = {name for variant in dataset.variants for sensor in variant.rig.sensors for name in sensor.capture}
    return [name for name in MODALITIES if name in taken]


def _file_set(name: str, includes: str, encoding: str, description: str) -> _Json:
    return {
        "@type": "cr:FileSet",
        "@id": f"files/{name}",
        "name": name,
        "description": description,
        "encodingFormat": encoding,
        "includes": includes,
    }


def _record_sets(dataset: DatasetPlan) -> Iterator[_Json]:
    """Yield the record sets: labels by frame, motion by frame and actor, and pictures."""
    place = _path_fields("frames", _LABELS, "labels\\.jsonl")
    columns = [_column("frames", _LABELS, "frame", "Integer"), _column("frames", _LABELS, "time", "Float")]
    yield _record_set("frames", "The labels of each frame.", [*place, *columns, _objects()])
    variant = _path_field("motion", _TRACKS, "variant", "^(?:.*/)?([^/]+)/tracks\\.csv$", "Text")
    fields = [variant, *(_column("motion", _TRACKS, name, kind) for name, kind in _MOTION.items())]
    yield _record_set("motion", "The motion of every actor in the world, metres and seconds.", fields)
    if _PICTURES in _captured(dataset):
        rest = f"{_PICTURES}/[0-9]+\\.[a-z]+"
        image = _field("pictures", "image", "sc:ImageObject", _source(_PICTURES, {"fileProperty": "content"}))
        number = _path_field("pictures", _PICTURES, "frame", "^(?:.*/)?([0-9]+)\\.[a-z]+$", "Integer")
        fields = [*_path_fields("pictures", _PICTURES, rest), number, image]
        yield _record_set("pictures", "The colour picture of each frame.", fields)


def _objects() -> _Json:
    """Return the field of the objects of a frame, one for each visible actor."""
    parts = []
    for name, (kind, description) in _OBJECT.items():
        source = {**_source(_LABELS, {"column": "objects"}), "transform": {"jsonPath": name}}
        part = _field("frames/objects", name, kind, source)
        shape: _Json = {"isArray": True, "arrayShape": "4"} if name == "bbox" else {}
        parts.append({**part, **shape, "description": description})
    return {"@type": "cr:Field", "@id": "frames/objects", "name": "objects", "repeated": True, "subField": parts}


def _record_set(name: str, description: str, fields: list[_Json]) -> _Json:
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": description, "field": fields}


def _path_fields(records: str, files: str, rest: str) -> list[_Json]:
    """Return the fields of the folders of variant and sensor, from the path of a file."""
    patterns = {"variant": _PLACE, "sensor": _SENSOR}
    return [_path_field(records, files, name, text.replace("{rest}", rest), "Text") for name, text in patterns.items()]


def _path_field(records: str, files: str, name: str, pattern: str, kind: str) -> _Json:
    source = {**_source(files, {"fileProperty": "fullpath"}), "transform": {"regex": pattern}}
    return _field(records, name, kind, source)


def _column(records: str, files: str, name: str, kind: str) -> _Json:
    return _field(records, name, kind, _source(files, {"column": name}))


def _source(files: str, extract: Mapping[str, str]) -> _Json:
    return {"fileSet": {"@id": f"files/{files}"}, "extract": dict(extract)}


def _field(records: str, name: str, kind: str, source: _Json) -> _Json:
    kind = kind if ":" in kind else f"sc:{kind}"
    return {"@type": "cr:Field", "@id": f"{records}/{name}", "name": name, "dataType": kind, "source": source}

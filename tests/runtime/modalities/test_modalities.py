"""Every modality of the registry answers the same questions, so a new one needs no test of these."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from recipe_compiler.ir.canonical import digest_array
from recipe_compiler.ir.modalities import CHOICES, KINDS, LABEL_MODALITIES, MODALITIES, form_of, listed
from recipe_compiler.ir.plan import DatasetPlan
from recipe_runtime.build.pipeline import BuildOptions, build
from recipe_runtime.core import layout
from recipe_runtime.dataset.reader import read
from recipe_runtime.frames.shot import shot
from recipe_runtime.modalities import declared, label_array, pixel_digest
from recipe_runtime.modalities.reading import stored_array
from recipe_runtime.report.difference import PixelDifference, first_difference
from recipe_runtime.webdataset import decode

from tests.runtime.fakes import ENGINES, Renderer, dataset_plan, sensor_plan
from tests.sources import ROOT

PLAN = dataset_plan(frames=2, weathers=1)
FILES = [(name, ending) for name in MODALITIES for ending in declared(name).files]
OTHERS = [(name, form.name) for name, forms in CHOICES.items() for form in forms[1:]]


def fake(name: str) -> NDArray[np.generic]:
    """Return the array of a modality in a frame of the fake scene."""
    (variant, _) = PLAN.variants
    renderer = Renderer(variant.scene)
    parts = np.zeros((3, 3, 4))
    parts[:, 0, 3], parts[:, 1, 3] = (4.0, 5.0, 6.0), (-1.0, 0.0, 1.0)
    seen = renderer.observe(sensor_plan().camera, np.zeros((3, 4)), parts)
    return label_array(seen, name) if name in LABEL_MODALITIES else renderer.picture(seen, variant.appearance, 0)


@pytest.mark.parametrize("name", MODALITIES)
def test_the_declaration_agrees_with_the_registry(name: str) -> None:
    made, forms = declared(name), KINDS[name].forms
    assert made.name == name
    assert {form.ending for form in forms} | {form.copy for form in forms if form.copy} == set(made.files)
    assert len({form.ending for form in forms}) == len(forms), "the ending of a file tells its form"
    assert KINDS[name].is_label == ((made.seen is not None) != (made.draw is not None))
    assert KINDS[name].help and all(form.help and form.size > 0 and form.seconds > 0 for form in forms)
    assert all(bool(form.copy) == (form.copy_size > 0) for form in forms)


@pytest.mark.parametrize("name", MODALITIES)
def test_arrays_have_the_declared_type(name: str) -> None:
    array, made = fake(name), declared(name)
    assert array.dtype == made.dtype
    assert array.shape == ((48, 64) if made.channels == 1 else (48, 64, made.channels))
    assert pixel_digest(name, array) == digest_array(f"pixels/{name}/1", array)


@pytest.mark.parametrize(("name", "ending"), FILES)
def test_a_file_is_decoded_to_what_was_encoded(name: str, ending: str) -> None:
    array, form = fake(name), declared(name).files[ending]
    body = declared(name).encoded(array, ending)
    again, stored = decode(f".{name}.{ending}", body), stored_array(body, ending, array.shape)
    assert (again.dtype, again.shape) == (array.dtype, array.shape)
    assert form.fits(stored) and np.array_equal(form.store(again), stored), "a second time, nothing is rounded"
    assert np.allclose(again, array, rtol=0, atol=form.tolerance)


@pytest.mark.parametrize(("name", "ending"), FILES)
def test_another_file_is_refused(name: str, ending: str) -> None:
    body = declared(name).encoded(fake(name), ending)
    for wrong in (b"", b"no picture", body[: len(body) // 2]):
        with pytest.raises(ValueError, match=rf"^\.{name}\.{ending}: "):
            decode(f".{name}.{ending}", wrong)
    with pytest.raises(ValueError, match=r"cannot be decoded|is not a picture"):
        stored_array(body, ending, (47, 64))


@pytest.mark.parametrize(("name", "ending"), FILES)
def test_a_pixel_that_differs_is_found(name: str, ending: str, tmp_path: Path) -> None:
    """By the smallest step of the stored array."""
    stored = declared(name).files[ending].store(fake(name)).copy()
    paths = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    encode = declared(name).files[ending].encode
    paths[0].write_bytes(encode(stored))
    stored[7, 9, ...] = np.nextafter(stored[7, 9], np.float32(9)) if stored.dtype.kind == "f" else stored[7, 9] ^ 1
    paths[1].write_bytes(encode(stored))
    found = first_difference(*paths)
    assert found is not None and (found.count, found.x, found.y) == (1, 9, 7)
    assert first_difference(paths[0], paths[0]) == PixelDifference(0)


@pytest.mark.parametrize("name", MODALITIES)
def test_a_shot_draws_a_picture(name: str, tmp_path: Path) -> None:
    made = shot(PLAN.variants[0], "street", 1, name, engines=ENGINES)
    picture = made.picture()
    assert picture.dtype == np.uint8 and picture.shape == (48, 64, 3)
    assert (picture != picture[0, 0]).any()
    made.write(tmp_path / "shot.png")
    assert np.array_equal(stored_array((tmp_path / "shot.png").read_bytes(), "png"), picture)


@pytest.mark.parametrize("name", MODALITIES)
def test_a_frames_file_has_the_ending_of_the_form(name: str) -> None:
    for form in KINDS[name].forms:
        path = layout.frame_file("a.b", "street", name, 7, {name: form.name})
        assert path == f"a_b/street/{name}/000007.{form.ending}"
        assert form_of(name, {name: form.name}) is form


@pytest.mark.parametrize("name", MODALITIES)
def test_the_documentation_describes_it(name: str) -> None:
    for page in ("recipe-language.md", "dataset.md"):
        assert f"`{name}`" in (ROOT / "docs" / page).read_text(encoding="utf-8"), page


@pytest.mark.parametrize(("name", "form"), OTHERS)
def test_a_dataset_has_the_chosen_form(name: str, form: str, tmp_path: Path) -> None:
    plan = dataset_plan(frames=2, weathers=1, forms={name: form}, annotations=("kwcoco",))
    assert plan.digest != dataset_plan(frames=2, weathers=1, annotations=("kwcoco",)).digest
    made = build(plan, tmp_path / "tiny", BuildOptions(workers=0, cache=tmp_path / "cache", engines=ENGINES))
    held = read(made.path)
    assert held.plan == plan
    chosen = form_of(name, plan.forms)
    for path in held.files:
        if f"/{name}/" in path:
            assert path.endswith((f".{chosen.ending}", f".{chosen.copy}"))
            stored = stored_array((made.path / path).read_bytes(), path.rpartition(".")[2])
            assert declared(name).files[path.rpartition(".")[2]].fits(stored)
    copies = [path for path in held.files if chosen.copy and path.endswith(f"/{name}/000001.{chosen.copy}")]
    assert len(copies) == (2 if chosen.copy else 0)  # for kwcoco


def test_plans_list_the_form_of_depth_and_others_that_are_not_the_default() -> None:
    """So plans from before a modality keep their digests."""
    assert PLAN.outputs == {"annotations": list(PLAN.annotations), "depth": "carla"}
    assert listed({name: forms[0].name for name, forms in CHOICES.items()}) == {"depth": "carla"}
    for wrong in ({"depth": "png"}, {"rgb": "png"}, {"fog": "npy"}):
        with pytest.raises(ValueError, match="has no form"):
            DatasetPlan(recipe="a", description="", variants=(), annotations=(), forms=wrong)


def test_modalities_are_declared_without_warp() -> None:
    """Readers of datasets, and workers of a DataLoader, do not wait for it."""
    code = "import sys, recipe_runtime.webdataset as w; from recipe_runtime.modalities import declared; "
    code += f"[declared(name) for name in {MODALITIES}]; print('warp' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"

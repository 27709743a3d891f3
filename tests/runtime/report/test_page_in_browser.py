"""The page of a dataset in a headless browser, from the file system: `make test-browser`."""

from __future__ import annotations

import io
import json
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from recipe_compiler.ir.plan import DatasetPlan, ScenarioPlan
from recipe_runtime.annotate.masks import unpacked
from recipe_runtime.dataset.reader import read
from recipe_runtime.loading import opened
from recipe_runtime.report.page import faults, site

from tests.runtime.fakes import dataset_plan
from tests.runtime.transfer.conftest import RECIPE, made

pytestmark = pytest.mark.browser

HOSTILE = "</script><img src=x onerror=page.broken=1>'\"\\u0041 %23#?&"


def hostile_plan() -> DatasetPlan:
    """Return a plan whose recipe, variants, sensors and actors have names that would be markup, paths or addresses."""
    plan = dataset_plan(frames=40)
    text = HOSTILE.replace("/", "").replace("\\", "")
    variants = []
    for variant in plan.variants:
        first, *others = variant.scene.actors
        scene = variant.scene.model_copy(update={"actors": (first.model_copy(update={"name": HOSTILE}), *others)})
        sensor, *rest = variant.rig.sensors
        rig = variant.rig.model_copy(update={"sensors": (sensor.model_copy(update={"name": text}), *rest)})
        responses = {text: variant.appearance.responses["street"], **variant.appearance.responses}
        appearance = variant.appearance.model_copy(update={"responses": responses})
        name = f"{variant.variant},x={text}"
        variants.append(ScenarioPlan(variant=name, scene=scene, rig=rig, appearance=appearance))
    parts = {"recipe": text, "description": HOSTILE, "variants": tuple(variants)}
    return DatasetPlan.model_validate({**parts, "annotations": (), "forms": plan.forms})


class Tab:
    """A page in the browser, with everything that it said and asked for."""

    def __init__(self, browser: Any, root: Path, hash: str = "", **options: Any) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []
        self.tab = browser.new_page(**options)
        self.tab.set_default_timeout(10_000)
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.on("requestfailed", lambda request: self.said.append(f"failed: {request.url}"))
        self.root = root
        self.tab.goto((root / "preview" / "index.html").as_uri() + hash)
        self.settle()

    def settle(self) -> None:
        """Wait until the frame of the state is drawn and its picture is loaded."""
        self.wait("page.shownFrame && page.drawn === page.turn && document.querySelector('#pane-a .over').complete")

    def js(self, script: str) -> Any:
        return self.tab.evaluate(script)

    def wait(self, script: str) -> None:
        """Wait until an expression is true; playwright's own wait needs `eval`, which the page forbids."""
        end = time.monotonic() + 10
        while not self.js(f"Boolean({script})"):
            assert time.monotonic() < end, script
            self.tab.wait_for_timeout(20)

    def press(self, key: str) -> None:
        self.tab.keyboard.press(key)
        self.settle()

    def drawn(self, canvas: str = "#pane-a canvas") -> int:
        """Return the number of pixels of a canvas that are not transparent."""
        return int(
            self.js(
                f"(() => {{ const from = document.querySelector('{canvas}'), to = document.createElement('canvas');"
                " [to.width, to.height] = [from.width, from.height];"
                " const pen = to.getContext('2d', { willReadFrequently: true }); pen.drawImage(from, 0, 0);"
                " const d = pen.getImageData(0, 0, to.width, to.height).data; let n = 0;"
                " for (let k = 3; k < d.length; k += 4) n += d[k] > 0; return n; })()"
            )
        )

    def check(self) -> None:
        """Check that nothing was reported, and that no request left the folder of the dataset."""
        assert self.said == []
        assert self.asked
        assert [url for url in self.asked if not url.startswith(f"{self.root.as_uri()}/")] == []
        self.tab.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("there is no Chromium here")
    with api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(hostile_plan(), tmp_path_factory.mktemp("hostile") / "data set#").root


@pytest.fixture(scope="module")
def patched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("patched")
    (folder / "recipe.yaml").write_text(RECIPE)
    plan, engines = opened(folder / "recipe.yaml")
    return made(plan, folder / "out", engines).root


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made(dataset_plan(frames=40), tmp_path_factory.mktemp("plain") / "tiny").root


def test_frames_follow_keys_slider_and_address(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain)
    tab.press("ArrowRight")
    tab.press("Shift+ArrowRight")
    assert tab.js("page.state.frame") == 11 and "frame=11" in tab.js("location.hash")
    assert tab.js("document.querySelector('#pane-a .over').src").endswith("/rgb/000011.png")
    tab.press("End")  # a chunk of labels that was not loaded yet
    assert tab.js("page.shownFrame.frame") == 39
    tab.js("(find('frame').value = 7, find('frame').dispatchEvent(new Event('input')))")
    tab.settle()
    assert tab.js("page.shownFrame.frame") == 7
    tab.press("Home")
    tab.tab.click("#play")
    tab.wait("page.state.frame > 2")
    tab.tab.click("#play")
    tab.settle()
    tab.check()


def test_the_shown_labels_are_those_of_the_dataset(browser: Any, plain: Path) -> None:
    """Independent: from labels.jsonl, decoded by pycocotools, not by the page's own reader of masks."""
    tab = Tab(browser, plain, "#frame=5&sensor=1")
    row = json.loads((plain / "weather=w0,jitter=still" / "side" / "labels.jsonl").read_text().split("\n")[5])
    shown = tab.js("page.shownFrame.objects.map((o) => [o.actor, o.instance, o.area, o.bbox])")
    assert shown == [[o["actor"], o["instance"], o["area"], o["bbox"]] for o in row["objects"]]
    assert len(shown) > 1
    owners = tab.js("Array.from(page.shownFrame.owners)")
    for number, item in enumerate(row["objects"], start=1):
        mask = unpacked(item["counts"], 64, 48)
        assert [k for k, owner in enumerate(owners) if owner == number] == mask.reshape(-1).nonzero()[0].tolist()
    tab.check()


def test_overlays_are_toggled(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain, "#frame=5")
    for key in "bi":  # shown at first
        tab.press(key)
    assert tab.drawn() == 0
    for key in "bmida":
        tab.press(key)
        assert tab.drawn() > 0, key
        tab.press(key)
        assert tab.drawn() == 0, key
    tab.tab.click("[data-toggle=masks]")
    tab.settle()
    assert tab.drawn() > 100 and tab.js("document.querySelector('[data-toggle=masks]').ariaPressed") == "true"
    tab.check()


def test_pictures_are_coloured(browser: Any, plain: Path) -> None:
    """A semantic picture has the colours of its palette, and depth those of the scale, on the screen."""
    tab = Tab(browser, plain, "#frame=5", viewport={"width": 900, "height": 700})
    for key in "bi":
        tab.press(key)
    layers = tab.js("[...document.querySelectorAll('[data-layer]')].map((b) => b.dataset.layer)")
    assert layers[:4] == ["rgb", "depth", "instance", "semantic"]
    tab.press(str(layers.index("semantic") + 1))
    assert _has(tab, (70, 130, 180)) and _has(tab, (220, 20, 60))  # CARLA's sky and pedestrians
    tab.press("2")
    assert _has(tab, (68, 1, 84)) and not _has(tab, (70, 130, 180))  # the sky is far
    assert "up to" in tab.tab.inner_text("#legend")
    tab.press("3")
    assert tab.drawn() > 1000
    tab.check()


def _has(tab: Tab, colour: tuple[int, int, int]) -> bool:
    """Return whether a hundredth of the stage has a colour, within the rounding of filters."""
    tab.tab.wait_for_timeout(200)
    picture = Image.open(io.BytesIO(tab.tab.locator("#stage").screenshot())).convert("RGB")
    near = (abs(np.asarray(picture).astype(int) - colour) <= 2).all(axis=-1)
    return bool(near.mean() > 0.01)


def test_two_variants_are_compared(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain)
    tab.press("c")
    assert tab.js("find('pane-b').hidden") is False
    sources = tab.js("[...document.querySelectorAll('.over')].map((i) => decodeURIComponent(i.src))")
    assert "weather=w0,jitter=still" in sources[0] and "weather=w0,jitter=shaky" in sources[1]
    tab.js("(find('split').value = 20, find('split').dispatchEvent(new Event('input')))")
    assert "20%" in tab.js("find('pane-b').style.clipPath")
    tab.tab.click("[data-tab=grid]")
    cells = tab.tab.locator(".cell")
    assert cells.count() == 4 and tab.tab.locator("#cells h3").all_inner_texts() == ["weather=w0", "weather=w1"]
    tab.wait("[...document.querySelectorAll('.cell img')].every((i) => i.naturalWidth === 64)")
    cells.nth(2).click()
    tab.settle()
    assert tab.js("page.variant.name") == "weather=w1,jitter=still"
    tab.press("]")
    assert tab.js("page.variant.name") == "weather=w1,jitter=shaky"
    tab.press("c")
    assert tab.js("find('pane-b').hidden") is True
    tab.check()


def test_objects_are_filtered_and_selected(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain, "#frame=5&sensor=1")
    rows = tab.tab.locator("#objects tbody tr")
    every = rows.count()
    tab.press("/")
    tab.tab.keyboard.type("hero2")
    tab.settle()
    assert every > 1 and rows.count() == 1 and "hero2" in rows.first.inner_text()
    rows.first.click()
    tab.settle()
    assert tab.js("page.state.selected") == 12002
    assert "distance" in tab.tab.inner_text("#details")
    tab.tab.fill("#filter", "")
    tab.tab.click("#classes button:has-text('Pedestrian')")
    tab.settle()
    assert rows.count() == 0 and tab.js("charts.hidden.has('Pedestrian')")
    tab.tab.click("#classes button:has-text('Pedestrian')")
    tab.settle()
    assert rows.count() == every
    tab.tab.fill("#least", "1000000")
    tab.settle()
    assert rows.count() == 0
    tab.check()


def test_a_part_is_enlarged_with_its_labels(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain, "#frame=5&sensor=1")
    x, y, w, h = tab.js("page.shownFrame.objects[0].bbox")
    stage = tab.tab.locator("#stage")
    box = stage.bounding_box()
    place = {"x": (x + w / 2) / 64 * box["width"], "y": (y + h / 2) / 48 * box["height"]}
    stage.dblclick(position=place)
    tab.settle()
    assert tab.js("page.zoom.by") == 2
    at = f"{{clientX: {box['x'] + place['x']}, clientY: {box['y'] + place['y']}}}"
    assert tab.js(f"page.objectAt({at}).instance") == tab.js("page.shownFrame.objects[0].instance")
    assert tab.js("document.querySelector('#pane-a .over').style.transform").startswith("scale(2) translate(-")
    before = tab.js("page.zoom.x")
    tab.tab.mouse.move(box["x"] + 200, box["y"] + 100)
    tab.tab.mouse.down()
    tab.tab.mouse.move(box["x"] + 150, box["y"] + 100)
    tab.tab.mouse.up()
    tab.settle()
    assert tab.js("page.zoom.x") > before
    tab.press("-")
    assert tab.js("page.zoom") == {"by": 1, "x": 0, "y": 0}
    tab.check()


def test_statistics_and_events_lead_to_their_frames(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain, "#tab=statistics")
    assert tab.tab.locator(".chart").count() == 6
    tab.tab.locator(".chart", has_text="visible pixels").locator(".column:not([aria-label$=': 0'])").last.click()
    tab.tab.locator("#examples button").first.click()
    tab.settle()
    chosen = tab.js("page.shownFrame.objects.find((o) => o.instance === page.state.selected).area")
    assert tab.js("page.state.tab") == "frames" and chosen > 100
    tab.tab.click("[data-tab=events]")
    tab.tab.fill("#event-filter", "collision")
    rows = tab.tab.locator("#event-rows tbody tr")
    tab.wait("find('event-count').textContent.startsWith('1 ')")
    assert rows.count() == 1
    first = int(re.match(r"\d+", rows.first.locator("td").nth(1).inner_text())[0])  # type: ignore[index]
    rows.first.click()
    tab.settle()
    assert tab.js("page.state.frame") == first and tab.js("page.state.tab") == "frames"
    tab.tab.click("[data-tab=about]")
    about = tab.tab.inner_text("#about")
    assert "recipe verify ." in about and read(plain).lock.identity in about
    tab.check()


def test_the_map_is_synchronised(browser: Any, plain: Path) -> None:
    tab = Tab(browser, plain, "#frame=5")
    rows = (plain / "weather=w0,jitter=still" / "tracks.csv").read_text().split("\n")
    head = rows[0].split(",")
    row = dict(zip(head, next(r for r in rows if r.startswith("5,") and ",van," in r).split(","), strict=True))
    now = tab.js("map.drawn.now[map.drawn.scene.actors.findIndex((a) => a[0] === 'van')]")
    assert now[0] == pytest.approx(float(row["x"]), abs=0.01) and now[1] == pytest.approx(float(row["y"]), abs=0.01)
    pose = tab.js("map.drawn.cameras.map((c) => [c.name, c.pose, c.current])")
    assert pose == [["street", [0, 0, 1, 0], True], ["side", [0, 0, 1, 0], False]]
    assert tab.drawn("#strip") > 0
    tab.check()


def test_patches_have_corners(browser: Any, patched: Path) -> None:
    tab = Tab(browser, patched)
    for key in "bip":
        tab.press(key)
    assert tab.drawn() == 0
    tab.press("p")
    assert tab.drawn() > 100 and [p["name"] for p in tab.js("page.shownPatches")] == ["poster"]
    tab.check()


def test_names_are_text(browser: Any, hostile: Path) -> None:
    tab = Tab(browser, hostile)
    assert tab.tab.inner_text("#description") == HOSTILE
    assert tab.js("document.querySelector('#pane-a .over').naturalWidth") == 64  # `%23#?` in a path
    assert HOSTILE in tab.tab.inner_text("#objects") or tab.js("page.shownFrame.objects.length") > 0
    for name in ("grid", "statistics", "events", "about"):
        tab.tab.click(f"[data-tab={name}]")
        tab.settle()
    assert tab.js("document.querySelectorAll('img[onerror], script:not([src^=\"page/\"])').length") == 0
    assert tab.js("page.broken") is None
    tab.check()


def test_data_cannot_name_a_script_elsewhere(browser: Any, plain: Path, tmp_path: Path) -> None:
    """`recipe view` checks the scripts in preview/data; data that name another one must not have it loaded."""
    shutil.copytree(plain, tmp_path / "tiny")
    (tmp_path / "tiny" / "plans" / "evil.js").write_text("page.broken = 1;")
    index = tmp_path / "tiny" / "preview" / "data" / "index.js"
    text = index.read_text()
    index.write_text(text.replace('"events":0', '"events":"x/../../../plans/evil"'))
    assert index.read_text() != text and faults(tmp_path / "tiny") == []
    page = browser.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((tmp_path / "tiny" / "preview" / "index.html").as_uri())
    page.wait_for_timeout(500)
    assert page.evaluate("page.broken") is None and not [url for url in asked if "evil" in url]
    assert page.is_visible("#notice")
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_it_without_scrolling_sideways(browser: Any, plain: Path, scheme: str) -> None:
    tab = Tab(browser, plain, viewport={"width": 360, "height": 740}, color_scheme=scheme, has_touch=True)
    for name in ("frames", "grid", "statistics", "events", "about"):
        tab.tab.click(f"[data-tab={name}]")
        tab.settle()
        assert tab.js("document.documentElement.scrollWidth") <= 360, name
    dark = tab.js("getComputedStyle(document.body).backgroundColor") == "rgb(21, 23, 27)"
    assert dark == (scheme == "dark")
    tab.check()


def test_no_other_script_and_no_network_is_allowed(browser: Any, plain: Path) -> None:
    """The policy blocks what an escaped name or a bug could ask for: inline scripts, and requests to hosts."""
    policy = re.search(rb'Content-Security-Policy" content="([^"]*)"', site()["preview/index.html"])
    assert policy is not None and b"unsafe" not in policy[1] and b"http" not in policy[1]
    tab = Tab(browser, plain)
    tab.js("document.body.insertAdjacentHTML('beforeend', '<img src=page/none.png onerror=\"page.broken=1\">')")
    tab.js("document.body.append(Object.assign(document.createElement('script'), {textContent: 'page.broken=2'}))")
    assert tab.js("fetch('data/index.js').then(() => 'read', () => 'refused')") == "refused"
    tab.tab.wait_for_timeout(300)
    assert tab.js("page.broken") is None
    tab.tab.close()

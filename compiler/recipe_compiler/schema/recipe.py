"""A recipe as a whole: its base scenario, its sweep and its outputs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, StringConstraints

from recipe_compiler.schema.camera import Sensor
from recipe_compiler.schema.fields import MAX_ASSETS, MAX_PROPS, Model, Name, Seed, distinct
from recipe_compiler.schema.scene import Actor, Asset, Clock, Prop, Town, Traffic
from recipe_compiler.schema.sweep import Sweep
from recipe_compiler.schema.weather import Geography, Weather


class Base(Model):
    """One scenario: what every variant starts from."""

    clock: Annotated[Clock, Field(description="When frames are taken.")]
    town: Annotated[Town, Field(description="The town, or its name.")]
    weather: Annotated[Weather, Field(description="The weather, or a preset's name.")] = Weather()
    time: Annotated[
        str | None,
        StringConstraints(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9](:[0-5][0-9])?$"),
        Field(description='Time of day, quoted: "19:40"; sets the sun, unless a sun angle is given by hand.'),
    ] = None
    place: Annotated[Geography, Field(description="Where `time` is told.")] = Geography()
    actors: Annotated[dict[Name, Actor], Field(description="Actors by name.")] = {}
    traffic: Annotated[Traffic, Field(description="Seeded others.")] = Traffic()
    props: Annotated[dict[Name, Prop], Field(max_length=MAX_PROPS, description="What stands about, by name.")] = {}
    sensors: Annotated[dict[Name, Sensor], Field(min_length=1, description="Sensors by name.")]


class Output(Model):
    """What is written besides the frames."""

    annotations: Annotated[
        tuple[Literal["kwcoco", "coco", "mots_txt", "mots_png"], ...],
        AfterValidator(distinct),
        Field(strict=False, description="Annotation formats."),
    ] = ("kwcoco", "coco")
    depth: Annotated[
        Literal["carla", "npy"], Field(description="Depth on disk: CARLA's 24-bit PNG, or float32 metres.")
    ] = "carla"


class Recipe(Model):
    """A recipe without its base and deltas, which are checked variant by variant."""

    recipe: Annotated[Name, Field(description="The dataset's name.")]
    description: Annotated[str, Field(max_length=2000, description="What the dataset is for.")] = ""
    seed: Annotated[Seed, Field(description="Seeds every draw; 0 is a seed like any other.")] = 0
    extends: Annotated[str | None, Field(description="A file below this one's folder that this one is laid over.")] = (
        None
    )
    assets: Annotated[
        dict[Name, Asset], Field(max_length=MAX_ASSETS, description="Files that the recipe brings, by name.")
    ] = {}
    sweep: Annotated[Sweep, Field(description="Which variants there are.")] = Sweep()
    output: Annotated[Output, Field(description="What is written.")] = Output()

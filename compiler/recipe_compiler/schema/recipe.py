"""A recipe as a whole: its base scenario, its sweep and its outputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, Field, StringConstraints, create_model

from recipe_compiler.ir.about import About
from recipe_compiler.ir.modalities import CHOICES, Form
from recipe_compiler.ir.patches import MAX_PATCHES
from recipe_compiler.ir.plan_types import MAX_SENSORS
from recipe_compiler.library.seasons import Season
from recipe_compiler.schema.camera import Sensor
from recipe_compiler.schema.fields import (
    MAX_ASSETS,
    MAX_BLUEPRINTS,
    MAX_PROPS,
    Model,
    Name,
    OwnBlueprint,
    Seed,
    distinct,
)
from recipe_compiler.schema.patches import Patch
from recipe_compiler.schema.scene import Actor, Asset, Blueprint, Clock, Prop, Town, Traffic
from recipe_compiler.schema.sweep import Sweep
from recipe_compiler.schema.weather import Geography, Weather


class Base(Model):
    """The scenario that all variants are derived from."""

    clock: Annotated[Clock, Field(description="Frame rate and length of the clips.")]
    town: Annotated[Town, Field(description="Town with its parameters, or the name of a town.")]
    weather: Annotated[Weather, Field(description="Weather parameters, or the name of a preset.")] = Weather()
    time: Annotated[
        str | None,
        StringConstraints(pattern=r"^([01][0-9]|2[0-3]):[0-5][0-9](:[0-5][0-9])?$"),
        Field(description='Time of day, quoted: "19:40". It sets the sun; angles given in `weather` override it.'),
    ] = None
    place: Annotated[Geography, Field(description="Geographical location and date, used with `time`.")] = Geography()
    season: Annotated[
        Season, Field(description="Colours of leaves, flowers and grass; labels are the same in all seasons.")
    ] = "summer"
    actors: Annotated[dict[Name, Actor], Field(description="Actors by name.")] = {}
    traffic: Annotated[Traffic, Field(description="Numbers of additional, randomly chosen actors.")] = Traffic()
    props: Annotated[dict[Name, Prop], Field(max_length=MAX_PROPS, description="Static objects by name.")] = {}
    patches: Annotated[
        dict[Name, Patch],
        Field(max_length=MAX_PATCHES, description="Textures on surfaces, by name; later ones lie over earlier ones."),
    ] = {}
    sensors: Annotated[dict[Name, Sensor], Field(min_length=1, max_length=MAX_SENSORS, description="Sensors by name.")]


class _Output(Model):
    """The files written in addition to the frames."""

    annotations: Annotated[
        tuple[Literal["kwcoco", "coco", "mots_txt", "mots_png"], ...],
        AfterValidator(distinct),
        Field(strict=False, description="List of annotation formats."),
    ] = ("kwcoco", "coco")

    @property
    def forms(self) -> dict[str, str]:
        """The form of the files of each modality that has several, by modality."""
        return {name: getattr(self, name) for name in CHOICES}


def _choice(name: str, forms: tuple[Form, ...]) -> tuple[object, str]:
    """Return type and default of the key that chooses among the forms of a modality."""
    text = ", ".join(f"{form.name} is {form.help}" for form in forms)
    chosen = Literal[tuple(form.name for form in forms)]  # type: ignore[valid-type]
    return Annotated[chosen, Field(description=f"File format of {name}: {text}.")], forms[0].name


if TYPE_CHECKING:
    Output = _Output
else:
    keys = {name: _choice(name, forms) for name, forms in CHOICES.items()}
    Output = create_model("Output", __base__=_Output, __doc__=_Output.__doc__, __module__=__name__, **keys)


class Recipe(Model):
    """A recipe without `base` and `deltas`, which are validated per variant."""

    recipe: Annotated[Name, Field(description="Name of the dataset.")]
    description: Annotated[str, Field(max_length=2000, description="Purpose of the dataset, as text.")] = ""
    about: Annotated[About, Field(description="Licence, authors, citation and responsible use of the dataset.")] = (
        About()
    )
    seed: Annotated[Seed, Field(description="Seed of all random draws.")] = 0
    extends: Annotated[
        str | None, Field(description="Recipe that this one extends: a file below this file's folder.")
    ] = None
    assets: Annotated[
        dict[Name, Asset], Field(max_length=MAX_ASSETS, description="Mesh and image files of the recipe, by name.")
    ] = {}
    blueprints: Annotated[
        dict[OwnBlueprint, Blueprint],
        Field(
            max_length=MAX_BLUEPRINTS,
            description="Types of actors from files, by id: `walker.pedestrian.NAME`, or `vehicle.` with sedan, "
            "hatchback, suv, van, pickup, bus or truck and a name.",
        ),
    ] = {}
    sweep: Annotated[Sweep, Field(description="Selection of variants. Default: all combinations of the deltas.")] = (
        Sweep()
    )
    output: Annotated[Output, Field(description="Output formats.")] = Output()

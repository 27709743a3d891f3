"""What a recipe states about its dataset for people and for catalogues: licence, authors, citation, responsible use.

No digest covers it. A recipe that states nothing has the dataset, byte for byte, of a release without these keys, but
for the files that describe it.
"""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import Field, StringConstraints

from recipe_compiler.ir.canonical import JsonValue
from recipe_compiler.ir.plan_types import Plan

MAX_TEXT = 4000
MAX_LINE = 300
MAX_AUTHORS = 200

Line = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x1f\x7f]*$", max_length=MAX_LINE)]
Text = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x08\x0b-\x1f\x7f]*$", max_length=MAX_TEXT)]
_SPDX = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+-]*")


class About(Plan):
    """Licence, authors, citation and responsible use of the dataset."""

    licence: Annotated[
        Line, Field(description="Licence of the dataset: an SPDX identifier such as CC-BY-4.0, a URL, or its name.")
    ] = ""
    authors: Annotated[
        tuple[Annotated[Line, Field(min_length=1)], ...],
        Field(max_length=MAX_AUTHORS, description="Names of the authors."),
    ] = ()
    citation: Annotated[Text, Field(description="How to cite the dataset: BibTeX, or text.")] = ""
    url: Annotated[
        Line, StringConstraints(pattern=r"^(https?://[^\s\"<>]+)?$"), Field(description="Web page of the dataset.")
    ] = ""
    version: Annotated[
        str,
        StringConstraints(pattern=r"^([0-9]{1,6}\.[0-9]{1,6}\.[0-9]{1,6})?$"),
        Field(description='Version of the dataset, quoted: "1.0.0".'),
    ] = ""
    uses: Annotated[Text, Field(description="What the dataset is meant for, and what it is not meant for.")] = ""
    limitations: Annotated[Text, Field(description="What the dataset lacks.")] = ""
    biases: Annotated[Text, Field(description="In what the dataset differs from what it stands for.")] = ""
    social_impact: Annotated[Text, Field(description="Good and harm that its use can do.")] = ""
    personal_information: Annotated[Text, Field(description="Information on real people that it contains.")] = ""

    @property
    def stated(self) -> dict[str, JsonValue]:
        """What the recipe states, as plain JSON values."""
        return self.model_dump(mode="json", exclude_defaults=True)

    @property
    def licence_url(self) -> str:
        """The URL of the licence; empty if only its name is known."""
        if re.match(r"https?://", self.licence):
            return self.licence
        return f"https://spdx.org/licenses/{self.licence}.html" if _SPDX.fullmatch(self.licence) else ""

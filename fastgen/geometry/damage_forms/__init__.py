"""Forms of damage: each a displacement field, and a hole for some."""

from fastgen.geometry.damage_forms.creased import CREASED
from fastgen.geometry.damage_forms.form import Form
from fastgen.geometry.damage_forms.kinked import KINKED
from fastgen.geometry.damage_forms.plain import BOW, EDGE, FOLD, STAR
from fastgen.geometry.damage_forms.ribs import RIBS
from fastgen.geometry.damage_forms.scraped import SCRAPED
from fastgen.geometry.damage_forms.torn import TORN
from fastgen.scene import Damage

FORMS: tuple[Form, ...] = (STAR, TORN, FOLD, RIBS, BOW, CREASED, EDGE, KINKED, SCRAPED)
"""All forms in the order in which the shaders go through them; those with holes come first, those
without displacement last."""

_BY_NAME = {(form.kind, form.name): form for form in FORMS}


def form_of(damage: Damage) -> Form:
    """Return the form of a damage."""
    return _BY_NAME[damage.kind, damage.form]

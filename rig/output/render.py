"""Pages of HTML that need nothing else: no script, no network, one style for paper and screen."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("rig.output"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def render(template: str, context: Mapping[str, Any]) -> str:
    """Fill a template of this package.

    Args:
        template: File name in `rig/output/templates`, such as `study.html`.
        context: Names the template uses. Text is escaped; figures from `rig.output.figures` are
            markup already and are not.

    Raises:
        jinja2.UndefinedError: The template uses a name that the context lacks.
    """
    return _environment().get_template(template).render(context)

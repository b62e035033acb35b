"""Templates of pages and of files for planners and simulators, and the door to the latter."""

import jinja2


def template(name: str) -> jinja2.Template:
    """The template of a file for planners or simulators, none of whose text is escaped."""
    loader = jinja2.PackageLoader("softjaw.study")
    return jinja2.Environment(loader=loader, trim_blocks=True, lstrip_blocks=True).get_template(name)

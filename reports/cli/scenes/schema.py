"""`touchstone schema`: the JSON Schema of scene files."""

from __future__ import annotations

from touchstone.reports.cli.options import PrintedOutOption, output_to


def schema(out: PrintedOutOption = None) -> None:
    """Print the JSON Schema of scene files, for editors and validators."""
    import json

    from touchstone.scenarios.files.schema import json_schema

    with output_to(out):
        print(json.dumps(json_schema(), indent=1))

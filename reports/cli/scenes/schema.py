"""`touchstone schema`: the JSON Schema of scene files."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON Schema of scene files, for editors and validators."""
    import json

    from touchstone.scenarios.files.schema import json_schema

    print(json.dumps(json_schema(), indent=1))

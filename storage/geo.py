"""GeoParquet 1.1 metadata: polygons in a building's own metric frame, for other tools to read."""

import json

import pyarrow as pa

LOCAL_CRS = {
    "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
    "type": "EngineeringCRS",
    "name": "building frame",
    "datum": {"type": "EngineeringDatum", "name": "building origin"},
    "coordinate_system": {
        "subtype": "Cartesian",
        "axis": [
            {"name": "x", "abbreviation": "x", "direction": "east", "unit": "metre"},
            {"name": "y", "abbreviation": "y", "direction": "north", "unit": "metre"},
        ],
    },
}


def with_geometry(schema: pa.Schema, name: str, kind: str) -> pa.Schema:
    """Return a schema that says its binary column `name` holds WKB of one kind."""
    column = {"encoding": "WKB", "geometry_types": [kind], "crs": LOCAL_CRS}
    geo = {"version": "1.1.0", "primary_column": name, "columns": {name: column}}
    return schema.with_metadata(schema.metadata | {b"geo": json.dumps(geo).encode()})

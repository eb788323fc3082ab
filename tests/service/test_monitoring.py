"""Alerts, dashboard and documentation against the metrics that the service really shows."""

import json
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import jsonschema
import promql_parser as promql
import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families as parse_metrics

from tests.support.paths import ROOT
from tests.support.service import distances, serving, upload_sample

ALERTS = yaml.safe_load((ROOT / "docker/prometheus/alerts.yaml").read_text())
DASHBOARD = json.loads((ROOT / "docker/grafana/dashboard.json").read_text())
PANELS = [panel for panel in DASHBOARD["panels"] if panel["type"] != "row"]

FROM_PROMETHEUS = {"instance", "job"}
"""Labels that Prometheus adds to whatever it scrapes."""

RULES = [rule for group in ALERTS["groups"] for rule in group["rules"]]


def expressions() -> Iterator[Any]:
    for rule in RULES:
        yield pytest.param(rule["expr"], id=rule["alert"])
    for panel in PANELS:
        for target in panel["targets"]:
            # Grafana fills these in.
            expression = target["expr"].replace("$__rate_interval", "5m").replace("$instance", ".*")
            yield pytest.param(expression, id=f"{panel['title']}-{target['refId']}")


EXPRESSIONS = list(expressions())


@dataclass
class Shown:
    """What a scrape has shown."""

    types: dict[str, str] = field(default_factory=dict)
    """By the name of a sample, of which a histogram has several"""
    labels: dict[str, dict[str, set[str]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(set))
    )
    """The values of each label, by the name of a sample"""
    families: set[str] = field(default_factory=set)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """The metrics of a service with keys that has answered, computed and refused."""
    shown = Shown()
    with serving(tmp_path_factory.mktemp("shown"), api_keys="alice:0123456789abcdef") as client:
        assert client.get("/v1").status_code == 401
        client.headers["Authorization"] = "Bearer 0123456789abcdef"
        mesh_id = upload_sample(client, "plane", 200)
        assert distances(client, mesh_id).status_code == 200
        text = client.get("/metrics").text
        operations = client.get("/openapi.json").json()["paths"].values()
    for family in parse_metrics(text):
        for sample in family.samples:
            shown.types[sample.name] = family.type
            for name, value in sample.labels.items():
                shown.labels[sample.name][name].add(value)
    shown.families = set(re.findall(r"^# TYPE (\S+)", text, re.MULTILINE))
    ids = {operation["operationId"] for path in operations for operation in path.values()}
    shown.labels["geodesic_requests_total"]["operation"] |= ids
    return shown


def nodes(expression: str) -> list[Any]:
    """Return the nodes of an expression, each before its children."""
    found: list[Any] = []
    promql.walk(promql.parse(expression), found.append)
    return found


def selectors(expression: str) -> list[Any]:
    return [node for node in nodes(expression) if isinstance(node, promql.VectorSelector)]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_an_expression_asks_for_what_there_is(shown: Shown, expression: str) -> None:
    assert selectors(expression)
    for selector in selectors(expression):
        assert selector.name in shown.types
        labels = shown.labels[selector.name]
        for matcher in selector.matchers.matchers:
            if matcher.name in FROM_PROMETHEUS:
                continue
            assert matcher.name in labels, f"{selector.name} has no label {matcher.name}"
            if matcher.op in (promql.MatchOp.Equal, promql.MatchOp.NotEqual):
                assert matcher.value in labels[matcher.name]
            elif matcher.name != "status":  # of which this service has answered few
                for alternative in matcher.value.split("|"):
                    assert alternative in labels[matcher.name]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_an_expression_groups_by_labels_that_there_are(shown: Shown, expression: str) -> None:
    for node in nodes(expression):
        if isinstance(node, promql.AggregateExpr) and node.modifier is not None:
            for selector in selectors(node.expr.prettify()):
                known = FROM_PROMETHEUS | set(shown.labels[selector.name])
                assert set(node.modifier.labels) <= known


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_growth_is_that_of_counters_and_quantiles_are_those_of_histograms(
    shown: Shown, expression: str
) -> None:
    inside = {
        selector.name
        for node in nodes(expression)
        if isinstance(node, promql.Call) and node.func.name in ("rate", "increase")
        for selector in selectors(node.prettify())
    }
    for selector in selectors(expression):
        is_counter = shown.types[selector.name] in ("counter", "histogram")
        assert is_counter == (selector.name in inside) or selector.name == "geodesic_build_info"
    for node in nodes(expression):
        if isinstance(node, promql.Call) and node.func.name == "histogram_quantile":
            quantile, buckets = node.args
            assert 0 < quantile.val < 1
            assert "le" in buckets.modifier.labels
            assert all(each.name.endswith("_bucket") for each in selectors(buckets.prettify()))


DURATION = {"type": "string", "pattern": r"^([0-9]+(ms|[smhdwy]))+$"}
TEXTS = {"type": "object", "additionalProperties": {"type": "string"}}


def closed(required: list[str], **properties: Any) -> dict[str, Any]:
    """Return the schema of an object that has no other members."""
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


ALERT = closed(
    ["alert", "expr", "labels", "annotations"],
    alert={"type": "string", "pattern": "^Geodesic[A-Za-z]+$"},
    expr={"type": "string"},
    **{"for": DURATION},
    labels=closed(["severity"], severity={"enum": ["critical", "warning", "info"]}),
    annotations=closed(
        ["summary", "description"],
        summary={"type": "string", "minLength": 1},
        description={"type": "string", "minLength": 1},
    ),
)
GROUP = closed(
    ["name", "rules"],
    name={"type": "string"},
    interval=DURATION,
    rules={"type": "array", "items": ALERT, "minItems": 1},
)


def test_alerts_are_a_file_of_rules() -> None:
    schema = closed(["groups"], groups={"type": "array", "items": GROUP, "minItems": 1})
    jsonschema.validate(ALERTS, schema)

    assert len({rule["alert"] for rule in RULES}) == len(RULES)


@pytest.mark.parametrize("rule", [pytest.param(rule, id=rule["alert"]) for rule in RULES])
def test_an_alert_names_the_labels_that_it_has(rule: dict[str, Any]) -> None:
    if "$labels" in "".join(rule["annotations"].values()):
        groupings = [
            set(node.modifier.labels)
            for node in nodes(rule["expr"])
            if isinstance(node, promql.AggregateExpr)
        ]
        named = set(re.findall(r"\$labels\.(\w+)", json.dumps(rule["annotations"])))
        assert all(named <= labels for labels in groupings)
        assert named <= FROM_PROMETHEUS


TARGET = {
    "type": "object",
    "required": ["refId", "expr", "legendFormat", "datasource"],
    "properties": {
        "expr": {"type": "string"},
        "datasource": {"const": {"type": "prometheus", "uid": "${datasource}"}},
    },
}
PANEL = {
    "type": "object",
    "required": ["id", "type", "title", "gridPos"],
    "properties": {
        "id": {"type": "integer", "minimum": 1},
        "type": {"enum": ["row", "timeseries"]},
        "title": {"type": "string", "minLength": 1},
        "gridPos": closed(
            ["x", "y", "w", "h"],
            x={"type": "integer", "minimum": 0, "maximum": 23},
            y={"type": "integer", "minimum": 0},
            w={"type": "integer", "minimum": 1, "maximum": 24},
            h={"type": "integer", "minimum": 1},
        ),
        "targets": {"type": "array", "items": TARGET, "minItems": 1},
    },
    "if": {"properties": {"type": {"const": "timeseries"}}},
    "then": {"required": ["targets", "fieldConfig", "datasource", "options"]},
}


def test_the_dashboard_is_one_that_can_be_imported() -> None:
    schema = {
        "type": "object",
        "required": ["uid", "title", "schemaVersion", "panels", "templating", "time"],
        "properties": {
            "uid": {"type": "string", "pattern": "^[a-zA-Z0-9_-]{1,40}$"},
            "schemaVersion": {"type": "integer", "minimum": 36},
            "panels": {"type": "array", "items": PANEL, "minItems": 1},
        },
        "not": {"required": ["id"]},  # Grafana gives it one
    }
    jsonschema.validate(DASHBOARD, schema)

    panels = DASHBOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    taken = [cell for panel in panels for cell in cells(**panel["gridPos"])]
    assert len(taken) == len(set(taken)), "panels overlap"
    assert max(x for x, _ in taken) < 24
    for panel in PANELS:
        refs = [target["refId"] for target in panel["targets"]]
        assert len(refs) == len(set(refs))


def cells(x: int, y: int, w: int, h: int) -> list[tuple[int, int]]:
    return [(x + i, y + j) for i in range(w) for j in range(h)]


def test_the_dashboard_uses_its_variables_and_no_others() -> None:
    own = {variable["name"] for variable in DASHBOARD["templating"]["list"]}
    used = set(re.findall(r"\$\{?(\w+)", json.dumps(PANELS)))

    assert used == own | {"__rate_interval"}


@pytest.mark.parametrize("panel", [pytest.param(each, id=each["title"]) for each in PANELS])
def test_a_legend_names_the_labels_that_its_series_have(panel: dict[str, Any]) -> None:
    for target in panel["targets"]:
        expression = target["expr"].replace("$__rate_interval", "5m")
        groupings = [
            set(node.modifier.labels) if node.modifier else set()
            for node in nodes(expression)
            if isinstance(node, promql.AggregateExpr)
        ] or [FROM_PROMETHEUS]
        named = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
        assert all(named <= labels for labels in groupings)
        if "{{" not in target["legendFormat"]:
            assert all(labels <= {"le"} for labels in groupings), "series that look alike"


def test_every_metric_is_on_the_dashboard_or_in_an_alert(shown: Shown) -> None:
    asked = {selector.name for each in EXPRESSIONS for selector in selectors(each.values[0])}
    families = {re.sub(r"_(bucket|total)$", "", name) for name in asked}

    missing = {re.sub("_total$", "", name) for name in shown.families} - families
    assert {name for name in missing if not name.endswith("_created")} == {"geodesic_meshes"}


def test_the_metrics_are_those_of_the_documentation(shown: Shown) -> None:
    text = (ROOT / "docs/operations.md").read_text()
    section = text.partition("## Metrics")[2].partition("\n## ")[0]
    rows = [row for row in section.splitlines() if row.startswith("| `geodesic_")]
    documented = {
        name for row in rows for name in re.findall("`(geodesic_\\w+)`", row.split("|")[1])
    }

    assert documented == {name for name in shown.families if not name.endswith("_created")}
    for row in rows:
        labels = set(re.findall("`(\\w+)`", row.split("|")[2]))
        for name in names_in(row):
            shown_labels = {
                label
                for sample, values in shown.labels.items()
                if sample in (name, f"{name}_bucket")
                for label in values
            }
            assert shown_labels - {"le"} == labels, name
    alerts = set(re.findall(r"^\| `(Geodesic\w+)` \|", text, re.MULTILINE))
    assert alerts == {rule["alert"] for rule in RULES}


def names_in(row: str) -> list[str]:
    return re.findall("`(geodesic_\\w+)`", row.split("|")[1])

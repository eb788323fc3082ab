// The current query as a curl command and as a Python program.

import { type Question, toWire } from "geodesic-client";
import { questionOf } from "../ask/fields";
import { endOf, stopsOf } from "../state/places";
import type { Point } from "../state/point";
import type { State } from "../state/state";

interface Query {
  path: string;
  body: unknown;
}

/** Return the question for the path from a source to a target. */
export function pathOf(state: State, source: Point, target: Point): Question<"path"> {
  return { source, target, waypoints: stopsOf(state), barriers: state.barriers };
}

/** Return the query for the path where there is a target, otherwise for the distances. */
function queryOf(state: State, source: Point): Query {
  const target = endOf(state);
  const mesh = `v1/meshes/${state.mesh}`;
  if (!target) return { path: `${mesh}/distances`, body: toWire(questionOf(state, state.method)) };
  const { waypoints, barriers, ...question } = pathOf(state, source, target);
  const more = {
    ...(waypoints?.length && { waypoints }),
    ...(barriers?.length && { barriers }),
  };
  return { path: `${mesh}/path`, body: toWire({ ...question, ...more }) };
}

export function curlOf(state: State, source: Point, service: string, hasKey: boolean): string {
  const { path, body } = queryOf(state, source);
  const key = hasKey ? ` -H "Authorization: Bearer $GEODESIC_KEY"` : "";
  return `curl '${service}${path}'${key} -H 'Content-Type: application/json' \\\n  -d '${JSON.stringify(body)}'`;
}

export function pythonOf(state: State, source: Point, service: string, hasKey: boolean): string {
  const { path, body } = queryOf(state, source);
  const key = hasKey ? `, "Authorization": "Bearer " + os.environ["GEODESIC_KEY"]` : "";
  const results = endOf(state) ? `answer["length"], answer["points"]` : `answer["distances"]`;
  return [
    "import json",
    ...(hasKey ? ["import os"] : []),
    "from urllib.request import Request, urlopen",
    "",
    `body = json.loads('${JSON.stringify(body)}')`,
    `headers = {"Content-Type": "application/json"${key}}`,
    `request = Request("${service}${path}", json.dumps(body).encode(), headers)`,
    "answer = json.load(urlopen(request))",
    `print(${results})`,
    "",
  ].join("\n");
}

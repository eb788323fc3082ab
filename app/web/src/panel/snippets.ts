// The current query as a curl command and as a Python program.
import type { Point } from "../api/types";
import { costOf } from "../ask/costs";
import { questionOf } from "../ask/fields";
import { endOf, stopsOf } from "../state/places";
import type { State } from "../state/state";

interface Query {
  path: string;
  body: unknown;
}

/** Return the query for the path where there is a target, otherwise for the distances. */
function queryOf(state: State, source: Point): Query {
  const { barriers } = state;
  const [target, waypoints] = [endOf(state), stopsOf(state)];
  const mesh = `v1/meshes/${state.mesh}`;
  if (!target) return { path: `${mesh}/distances`, body: questionOf(state, state.method) };
  const cost = costOf(state);
  const more = {
    ...(cost && { cost }),
    ...(waypoints.length > 0 && { waypoints }),
    ...(barriers.length > 0 && { barriers }),
  };
  return { path: `${mesh}/path`, body: { source, target, ...more } };
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

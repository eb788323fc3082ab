// The current query as a curl command and as a Python program.

import { type Question, toWire } from "geodesic-client";
import { costOf } from "../ask/costs";
import { questionOf } from "../ask/fields";
import { blockedFaces } from "../state/barriers";
import { endOf, stopsOf } from "../state/places";
import type { Point } from "../state/point";
import type { State } from "../state/state";

type Body = Record<string, unknown>;

/** Return the question for the path from a source to a target. */
export function pathOf(state: State, source: Point, target: Point): Question<"path"> {
  const cost = costOf(state);
  const question = { source, target, waypoints: stopsOf(state), barriers: blockedFaces(state) };
  return cost ? { ...question, cost } : question;
}

/** Return the query that a state asks, by its end and its members in the service's names. */
function queryOf(state: State, source: Point): { kind: "path" | "distances"; body: Body } {
  const target = endOf(state);
  if (!target) return { kind: "distances", body: toWire(questionOf(state, state.method)) };
  const { waypoints, barriers, ...question } = pathOf(state, source, target);
  const more = {
    ...(waypoints?.length && { waypoints }),
    ...(barriers?.length && { barriers }),
  };
  return { kind: "path", body: toWire({ ...question, ...more }) };
}

export function curlOf(state: State, source: Point, address: string, hasKey: boolean): string {
  const { kind, body } = queryOf(state, source);
  const key = hasKey ? ` -H "Authorization: Bearer $GEODESIC_KEY"` : "";
  return `curl '${address}v1/meshes/${state.mesh}/${kind}'${key} -H 'Content-Type: application/json' \\\n  -d '${JSON.stringify(body)}'`;
}

/** Return a program for the Python client; its members are those of the request, and JSON is Python. */
export function pythonOf(state: State, source: Point, address: string, hasKey: boolean): string {
  const { kind, body } = queryOf(state, source);
  const key = hasKey ? `, api_key=os.environ["GEODESIC_KEY"]` : "";
  const members = Object.entries(body).map(([name, value]) => `${name}=${JSON.stringify(value)}`);
  return [
    ...(hasKey ? ["import os"] : []),
    "from geodesic_client import Client",
    "",
    `client = Client(${JSON.stringify(address)}${key})`,
    `found = client.${kind}("${state.mesh}", ${members.join(", ")})`,
    `print(${kind === "path" ? "found.length, found.points" : "found.distances"})`,
    "",
  ].join("\n");
}

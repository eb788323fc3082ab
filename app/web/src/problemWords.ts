// What the service says of a question, by the names of the page's fields.
import type { ProblemError } from "geodesic-client";

/** The fields of the page by the members of a request. */
const FIELDS: Record<string, string> = {
  source: "Source",
  sources: "Sources",
  target: "Target",
  targets: "Target",
  waypoints: "Via",
  barriers: "Barriers",
  max_distance: "Up to",
  relative_error: "Allowed error",
  effort: "Effort",
  levels: "Isolines",
  count: "Isolines",
};

/** Return what is wrong, with the field where a JSON pointer names the member of a request. */
export function inWords({ detail, errors }: Pick<ProblemError, "detail" | "errors">): string {
  const [fault] = errors;
  if (!fault || detail !== `${fault.pointer}: ${fault.message}`) return detail;
  const field = FIELDS[fault.pointer.split("/")[1] ?? ""];
  return field ? `${field}: ${fault.message}` : fault.message;
}

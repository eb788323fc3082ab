// Problem documents of the service (RFC 9457) as exceptions.
import type { Problem } from "./types";

/** The members of a problem that are always there; a problem of our own making has no others. */
type ProblemLike = Pick<Problem, "detail" | "code" | "status" | "request_id"> & Partial<Problem>;

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

/** An error that the service has explained; its message is for people. */
export class ProblemError extends Error {
  constructor(readonly problem: ProblemLike) {
    super(inWords(problem));
  }
}

/** Return what is wrong, with the field where a JSON pointer names the member of a request. */
function inWords({ detail, errors }: ProblemLike): string {
  const [fault] = errors ?? [];
  if (!fault || detail !== `${fault.pointer}: ${fault.message}`) return detail;
  const field = FIELDS[fault.pointer.split("/")[1] ?? ""];
  return field ? `${field}: ${fault.message}` : fault.message;
}

export async function problemOfResponse(response: Response): Promise<ProblemError> {
  const text = await response.text();
  return parseProblem(response.status, text, response.headers.get("X-Request-ID") ?? "");
}

/** Parse a problem document. Anything else, such as a proxy's page, is described by its status. */
export function parseProblem(status: number, text: string, requestId: string): ProblemError {
  try {
    return new ProblemError(JSON.parse(text) as Problem);
  } catch {
    const detail = `The service answered with status ${status} and gave no reason.`;
    return new ProblemError({ detail, code: "unknown", status, request_id: requestId });
  }
}

// Problem documents of the service (RFC 9457) as exceptions.
import type { Problem } from "./types";

/** The members of a problem that are always there; a problem of our own making has no others. */
type ProblemLike = Pick<Problem, "detail" | "code" | "status" | "request_id"> & Partial<Problem>;

/** An error that the service has explained. */
export class ProblemError extends Error {
  constructor(readonly problem: ProblemLike) {
    super(problem.detail);
  }
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

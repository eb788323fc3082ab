// What the service says when it does not do what it was asked to.
import type { Problem } from "./types";

export class ProblemError extends Error {
  constructor(
    readonly problem: Pick<Problem, "detail" | "code" | "status" | "request_id"> & Partial<Problem>,
  ) {
    super(problem.detail);
  }
}

export async function problemOfResponse(response: Response): Promise<ProblemError> {
  const text = await response.text();
  return parseProblem(response.status, text, response.headers.get("X-Request-ID") ?? "");
}

/** Make an exception of a refusal; what is no problem document, a proxy's page, is told by its status. */
export function parseProblem(status: number, text: string, requestId: string): ProblemError {
  try {
    return new ProblemError(JSON.parse(text) as Problem);
  } catch {
    const detail = `The service answered ${status} without saying why.`;
    return new ProblemError({ detail, code: "unknown", status, request_id: requestId });
  }
}

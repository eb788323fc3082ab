// Problem documents of the service (RFC 9457) as exceptions.
import type { Problem } from "./types.js";

/** The members that are always there; a document about a proxy's answer, say, has no others. */
export type ProblemLike = Pick<Problem, "detail" | "code" | "status" | "request_id"> &
  Partial<Problem>;

/** The service refused, or failed, and told why. */
export class ProblemError extends Error {
  override readonly name = "ProblemError";

  constructor(
    /** The whole problem. */
    readonly document: ProblemLike,
    /** Seconds after which the request may succeed, where the service said so. */
    readonly retryAfter: number | null = null,
  ) {
    super(`${document.code}: ${document.detail}${document.hint ? ` (${document.hint})` : ""}`);
  }

  /** The HTTP status. */
  get status(): number {
    return this.document.status;
  }

  /** The kind of problem; `/problems/{code}` of the service has its meaning. */
  get code(): string {
    return this.document.code;
  }

  /** What is wrong. */
  get detail(): string {
    return this.document.detail;
  }

  /** What to do, if the service knows it. */
  get hint(): string | null {
    return this.document.hint ?? null;
  }

  /** The elements of the request at fault, by their JSON pointers. */
  get errors(): NonNullable<Problem["errors"]> {
    return this.document.errors ?? [];
  }

  /** The id of the request in the log of the service. */
  get requestId(): string {
    return this.document.request_id;
  }
}

export async function problemOf(response: Response): Promise<ProblemError> {
  const { status, headers } = response;
  return parseProblem(status, await response.text(), (name) => headers.get(name));
}

/** Parse a problem document. Anything else, such as a proxy's page, is described by its status. */
export function parseProblem(
  status: number,
  text: string,
  header: (name: string) => string | null,
): ProblemError {
  const seconds = Number(header("Retry-After") ?? Number.NaN);
  return new ProblemError(
    documentOf(status, text, header("X-Request-ID") ?? ""),
    Number.isFinite(seconds) ? seconds : null,
  );
}

function documentOf(status: number, text: string, requestId: string): ProblemLike {
  try {
    const document: unknown = JSON.parse(text);
    if (typeof document === "object" && document !== null && "detail" in document) {
      return document as Problem;
    }
  } catch {
    // It is told by its status.
  }
  const detail = `The service answered with status ${status} and gave no reason.`;
  return { detail, code: "unknown", status, request_id: requestId };
}

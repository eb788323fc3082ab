// What the service says when it does not do what it was asked to.
import type { Problem } from "./types";

export class Refusal extends Error {
  constructor(readonly problem: Pick<Problem, "detail" | "code" | "status" | "request_id"> & Partial<Problem>) {
    super(problem.detail);
  }
}

export async function refusalOf(response: Response): Promise<Refusal> {
  const text = await response.text();
  return refusal(response.status, text, response.headers.get("X-Request-ID") ?? "");
}

/** Make an exception of a refusal; what is no problem document, a proxy's page, is told by its status. */
export function refusal(status: number, text: string, requestId: string): Refusal {
  try {
    return new Refusal(JSON.parse(text) as Problem);
  } catch {
    const detail = `The service answered ${status} without saying why.`;
    return new Refusal({ detail, code: "unknown", status, request_id: requestId });
  }
}

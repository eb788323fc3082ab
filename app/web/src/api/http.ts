// Every request goes through here: the key is added, and a refusal becomes an exception.
import type { Problem } from "./types";

export class Refusal extends Error {
  constructor(readonly problem: Pick<Problem, "detail" | "code" | "status" | "request_id"> & Partial<Problem>) {
    super(problem.detail);
  }
}

const PLACE = "geodesic-key";
let key = sessionStorage.getItem(PLACE) ?? "";

export function setKey(text: string): void {
  key = text.trim();
  if (key) sessionStorage.setItem(PLACE, key);
  else sessionStorage.removeItem(PLACE);
}

export function authorization(): Record<string, string> {
  return key ? { Authorization: `Bearer ${key}` } : {};
}

export async function call(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = { ...authorization(), ...(init.headers as Record<string, string> | undefined) };
  const response = await fetch(path, { ...init, headers });
  if (!response.ok) throw await refusalOf(response);
  return response;
}

export async function getJson<T>(path: string, signal?: AbortSignal): Promise<T> {
  return (await call(path, signal ? { signal } : {})).json() as Promise<T>;
}

export function post(
  path: string,
  body: unknown,
  headers: Record<string, string> = {},
  signal?: AbortSignal,
): Promise<Response> {
  return call(path, {
    method: "POST",
    headers: { "Content-Type": "application/json", ...headers },
    body: JSON.stringify(body),
    ...(signal ? { signal } : {}),
  });
}

async function refusalOf(response: Response): Promise<Refusal> {
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

export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

// The service that offers the page, and the key to it.
import { GeodesicClient } from "geodesic-client";

const STORAGE_NAME = "geodesic-key";

export const service = new GeodesicClient(new URL(".", location.href), {
  apiKey: sessionStorage.getItem(STORAGE_NAME),
});

/** Set the API key, and remember it while the tab is open; an empty text forgets it. */
export function setKey(text: string): void {
  service.apiKey = text.trim() || null;
  if (service.apiKey) sessionStorage.setItem(STORAGE_NAME, service.apiKey);
  else sessionStorage.removeItem(STORAGE_NAME);
}

export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

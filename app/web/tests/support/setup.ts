// Node has no session storage; the page reads its key from there when it starts.
import { beforeEach, vi } from "vitest";

const values = new Map<string, string>();

vi.stubGlobal("sessionStorage", {
  getItem: (name: string) => values.get(name) ?? null,
  setItem: (name: string, value: string) => void values.set(name, value),
  removeItem: (name: string) => void values.delete(name),
});

beforeEach(() => values.clear());

// Node has no session storage and no address; the page reads them when it starts.
import { beforeEach, vi } from "vitest";

const values = new Map<string, string>();

vi.stubGlobal("location", { href: "http://127.0.0.1/?mesh=m" });
vi.stubGlobal("sessionStorage", {
  getItem: (name: string) => values.get(name) ?? null,
  setItem: (name: string, value: string) => void values.set(name, value),
  removeItem: (name: string) => void values.delete(name),
});

beforeEach(() => values.clear());

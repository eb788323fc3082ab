// Server-sent events, read by fetch because EventSource cannot send a key.
import type { Connection } from "./connection.js";

interface Event {
  id: string;
  data: string;
}

/** Yield the events of a stream until it ends; ``lastId`` resumes after that event. */
export async function* events(
  connection: Connection,
  path: string,
  lastId: string,
  signal?: AbortSignal,
): AsyncGenerator<Event> {
  const headers = { Accept: "text/event-stream", ...(lastId ? { "Last-Event-ID": lastId } : {}) };
  const { body } = await connection.call(path, { headers, ...(signal && { signal }) });
  if (!body) return;
  const reader = body.getReader();
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const text = rest + decoder.decode(value, { stream: true });
    const blocks = text.replaceAll("\r\n", "\n").split("\n\n");
    rest = blocks.pop() ?? "";
    for (const block of blocks) {
      const event = parse(block);
      if (event.data) yield event;
    }
  }
}

function parse(block: string): Event {
  const event = { id: "", data: "" };
  for (const line of block.split("\n")) {
    const [, name, value = ""] = /^(id|data): ?(.*)$/.exec(line) ?? [];
    if (name === "id") event.id = value;
    if (name === "data") event.data += value;
  }
  return event;
}

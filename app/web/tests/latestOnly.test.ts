import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { LatestOnly } from "../src/ask/latestOnly";
import { Random } from "./support/random";

beforeEach(() => void vi.useFakeTimers());
afterEach(() => void vi.useRealTimers());

/** A server that needs ``milliseconds`` for each request, and notes what became of it. */
class Server {
  readonly log: string[] = [];
  running = 0;
  readonly fail = vi.fn();
  readonly latestOnly: LatestOnly<number>;

  constructor(private readonly milliseconds: () => number) {
    this.latestOnly = new LatestOnly(
      (request, stop) => this.answer(request, stop.signal),
      this.fail,
    );
  }

  private async answer(request: number, signal: AbortSignal): Promise<void> {
    this.running += 1;
    expect(this.running, "requests at once").toBe(1);
    try {
      await new Promise((resolve, reject) => {
        setTimeout(resolve, this.milliseconds());
        signal.addEventListener("abort", () => reject(signal.reason));
      });
      this.log.push(`answered ${request}`);
    } catch (error) {
      this.log.push(`aborted ${request}`);
      throw error;
    } finally {
      this.running -= 1;
    }
  }
}

test("a request alone is answered", async () => {
  const server = new Server(() => 5000);
  server.latestOnly.ask(1);
  await vi.runAllTimersAsync();

  expect(server.log).toEqual(["answered 1"]);
});

test("of those that wait only the latest is answered", async () => {
  const server = new Server(() => 50);
  for (const request of [1, 2, 3, 4]) server.latestOnly.ask(request);
  await vi.runAllTimersAsync();

  expect(server.log).toEqual(["answered 1", "answered 4"]);
});

test("an answer is refined once requests rest, and for no old one", async () => {
  const log: string[] = [];
  const latestOnly = new LatestOnly<number>(async (request, { signal }) => {
    log.push(`answered ${request}`);
    if (!(await latestOnly.rests())) return;
    log.push(`refines ${request}`);
    await new Promise((resolve, reject) => {
      setTimeout(resolve, 1000);
      signal.addEventListener("abort", () => reject(signal.reason));
    });
    log.push(`refined ${request}`);
  }, vi.fn());
  for (const request of [1, 2, 3]) {
    latestOnly.ask(request);
    await vi.advanceTimersByTimeAsync(50);
  }
  expect(log, "a pointer that moves").toEqual(["answered 1", "answered 2", "answered 3"]);
  await vi.advanceTimersByTimeAsync(50);
  expect(log.at(-1)).toBe("refines 3");
  latestOnly.ask(4); // aborts what refines 3, without patience
  await vi.advanceTimersByTimeAsync(1);
  expect(log.slice(4)).toEqual(["answered 4"]);
  await vi.runAllTimersAsync();
  expect(log.slice(5)).toEqual(["refines 4", "refined 4"]);
});

test("a superseded request is aborted after 100 ms, and not before", async () => {
  const server = new Server(() => 10_000);
  server.latestOnly.ask(1);
  await vi.advanceTimersByTimeAsync(500); // alone it may take its time
  server.latestOnly.ask(2);
  await vi.advanceTimersByTimeAsync(99);
  expect(server.log).toEqual([]);
  await vi.advanceTimersByTimeAsync(1);
  expect(server.log).toEqual(["aborted 1"]);
  await vi.runAllTimersAsync();

  expect(server.log).toEqual(["aborted 1", "answered 2"]);
  expect(server.fail).not.toHaveBeenCalled();
});

test("the patience with one request is not spent on the next", async () => {
  const server = new Server(() => 90);
  server.latestOnly.ask(1);
  await vi.advanceTimersByTimeAsync(40);
  server.latestOnly.ask(2);
  await vi.advanceTimersByTimeAsync(60); // at 90 ms the second one begins
  server.latestOnly.ask(3);
  await vi.advanceTimersByTimeAsync(50); // at 140 ms the patience with the first one is over
  expect(server.log).toEqual(["answered 1"]);
  await vi.runAllTimersAsync();

  expect(server.log).toEqual(["answered 1", "answered 2", "answered 3"]);
});

test("on a slow server a stream of requests is answered now and then", async () => {
  const server = new Server(() => 700);
  for (let request = 0; request < 300; request++) {
    server.latestOnly.ask(request);
    await vi.advanceTimersByTimeAsync(20);
  }
  await vi.runAllTimersAsync();

  const answered = server.log.filter((line) => line.startsWith("answered"));
  expect(answered.length).toBeGreaterThan(3);
  expect(server.log.at(-1)).toBe("answered 299");
});

test("an error is reported, and the next request answered all the same", async () => {
  const fail = vi.fn();
  const answered: number[] = [];
  const latestOnly = new LatestOnly<number>(async (request) => {
    if (request === 1) throw new Error("broken");
    answered.push(request);
  }, fail);
  latestOnly.ask(1);
  latestOnly.ask(2);
  await vi.runAllTimersAsync();

  expect(fail.mock.calls).toEqual([[new Error("broken")]]);
  expect(answered).toEqual([2]);
});

test("cancelling aborts what runs, drops what waits, and leaves room for more", async () => {
  const server = new Server(() => 50);
  server.latestOnly.ask(1);
  server.latestOnly.ask(2);
  server.latestOnly.cancel();
  await vi.runAllTimersAsync();
  expect(server.log).toEqual(["aborted 1"]);

  server.latestOnly.ask(3);
  await vi.runAllTimersAsync();
  expect(server.log).toEqual(["aborted 1", "answered 3"]);
});

test("whatever comes when, one request runs at a time and the last one is answered", async () => {
  const random = new Random(8);
  for (let i = 0; i < 100; i++) {
    const server = new Server(() => random.pick([1, 30, 150, 600]));
    const last = 1 + random.below(20);
    for (let request = 0; request <= last; request++) {
      server.latestOnly.ask(request);
      await vi.advanceTimersByTimeAsync(random.pick([0, 0, 10, 100, 400]));
    }
    await vi.runAllTimersAsync();
    expect(server.log.at(-1)).toBe(`answered ${last}`);
    const order = server.log.map((line) => Number(line.split(" ")[1]));
    expect(order).toEqual([...order].sort((a, b) => a - b));
    expect(server.fail).not.toHaveBeenCalled();
  }
});

// Asks a running service everything through the client: node program.mts URL. Lengths on the unit
// square are known, since its surface is flat.
import assert from "node:assert/strict";
import { GeodesicClient, type Point, ProblemError } from "geodesic-client";

const url = process.argv[2] as string;
const client = new GeodesicClient(url);
const DIAGONAL = Math.SQRT2;
const near = (found: number | null | undefined, expected: number, most = 1e-9) =>
  assert.ok(Math.abs((found ?? Number.NaN) - expected) < most, `${found} is not ${expected}`);

assert.ok((await client.about()).samples.includes("plane"));
const square = await client.sample("plane", 200); // 11 × 11 vertices, row by row
const [vertices, faces] = await Promise.all([
  client.array(square, "vertices"),
  client.array(square.id, "faces"),
]);
assert.deepEqual([vertices.shape, faces.shape], [[121, 3], [200, 3]]);
const far = (v: number) => Math.hypot(vertices.data[3 * v] ?? NaN, vertices.data[3 * v + 1] ?? NaN);

// Meshes: arrays are stored to the bit, and a file is told by its name.
const again = await client.upload({ vertices: vertices.data, faces: faces.data }, { name: "copy.ply" });
assert.deepEqual((await client.array(again, "vertices")).data, vertices.data);
assert.deepEqual((await client.array(again, "faces")).data, faces.data);
const apart = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 1 2 3\nf 4 5 6\n";
const two = await client.upload(new Blob([apart]), { name: "two.obj", merge: "exact" });
assert.equal((await client.mesh(two.id)).name, "two.obj");
const { meshes } = await client.meshes({ name: "two.obj" });
assert.deepEqual(meshes.map(({ id }) => id), [two.id]);

// Distances
const field = await client.distances(square, 0);
assert.ok(field.distances instanceof Float64Array && field.error_bound.value === 0);
for (const v of field.distances.keys()) near(field.distances[v], far(v));
near((await client.distances(square, [0], { targets: [120] })).distances[0], DIAGONAL);
const more = await client.distances(two, [0, 1], { include: ["nearest_source"] });
assert.deepEqual([...more.distances], [0, 0, 1, Infinity, Infinity, Infinity]);
assert.deepEqual(more.nearest_source, new Int32Array([0, 1, 0, -1, -1, -1]));
assert.equal(more.unreachable.disconnected, 3);
const proved = await client.distances(square, 0, { certify: true, include: ["lower", "upper"] });
assert.equal(proved.certificate?.holds, true);
near(proved.lower?.[120], DIAGONAL);
const fast = await client.distances(square, 0, { method: "fast", effort: 1 });
assert.ok((fast.distances[120] ?? 0) >= DIAGONAL - 1e-9 && fast.method === "fast");
const from = await client.distances(square, { vertex: 0, start_distance: 0.5 }, { maxDistance: 1 });
assert.deepEqual([from.distances[0], from.distances[120]], [0.5, Infinity]);

// Paths and lines
const path = await client.path(square, 0, 120, { waypoints: [10] });
near(path.length, 2);
near((await client.path(square, 0, { face: 199, barycentric: [0, 0, 1] })).length, far(faces.data[599] ?? 0));
assert.equal((await client.path(two, 0, 4)).reason, "disconnected");
assert.equal((await client.pathSteps(square, 0, 120)).steps.at(-1)?.name, "path");
assert.deepEqual((await client.paths(square, 0, [10, 120])).paths.map(({ status }) => status), ["ok", "ok"]);
const { isolines } = await client.isolines(square, 0, { levels: [0.5] });
near(isolines[0]?.lines[0]?.length, Math.PI / 4, 1e-4); // a polygon
const heights = vertices.data.filter((_, i) => i % 3 === 0);
const ofValues = await client.isolines(square, heights, { levels: [0.25] });
near(ofValues.isolines[0]?.lines[0]?.length, 1);
const [border] = (await client.borders(square, [0, 10])).borders;
near(border?.length, 1);
const [edge] = (await client.boundaries(square, { include: ["locations"] })).boundaries;
near(edge?.length, 4);
assert.equal((await client.loops(square)).lines.length, 0);
const bent: Point[] = (await client.path(square, 0, 120, { waypoints: [50] })).locations ?? [];
near((await client.straighten(square, [{ polyline: bent }])).lines[0]?.length, DIAGONAL);
const { lines } = await client.trace(square, [0], [[1, 1, 0]], [0.5]);
near(lines[0]?.length, 0.5);
const cut = await client.cut(square, [{ polyline: (await client.path(square, 0, 120)).locations ?? [] }]);
assert.equal(cut.parts, 2);
assert.equal(new Set((await client.array(cut.cut_mesh_id, "parts")).data).size, 2);
await client.deleteMesh(cut.cut_mesh_id);

// Many points
const dense = await client.matrix(square, [0, 120], { targets: [0, 10, 120] });
assert.deepEqual(dense.shape, [2, 3]);
[0, 1, DIAGONAL, DIAGONAL, 1, 0].forEach((each, i) => near(dense.distances[i], each));
const pairs = await client.matrix(square, [0, 10], { targets: [120, 120], layout: "pairs" });
[DIAGONAL, 1].forEach((each, i) => near(pairs.distances[i], each));
const sparse = await client.matrix(two, [0, 3], { layout: "sparse" });
assert.deepEqual([...(sparse.rows ?? [])], [0, 1]);
assert.deepEqual([...(sparse.columns ?? [])], [0, 1]);
assert.deepEqual((await client.nearest(square, 0, [120, 10], { k: 1 })).nearest.map((n) => n.candidate), [1]);
const samples = await client.samples(square, { count: 4, starts: [0], include: ["distances"] });
assert.equal(samples.points.length, 4);
assert.equal(samples.distances?.length, 121);
const { areas } = await client.cells(square, [0, 10]);
near(areas.reduce((sum, area) => sum + area, 0), 1);
near((await client.mean(square, [0, 120])).mean.position?.[0], 0.5);
const map = await client.logMap(square, 0, { xAxis: [1, 0, 0] });
near(map.total_angle, Math.PI / 2);
near(map.angles[120], Math.PI / 4);
near(map.coordinates[2 * 120 + 1], 1);
const sweep = await client.sweepSteps(square, 0, { steps: 5 });
near(sweep.distances[120], DIAGONAL);
const [below, none] = (await client.locate(square, [[0.5, 0.5, 3], [9, 9, 9]], { maxDistance: 4 })).points;
near(below?.distance, 3);
assert.equal(none, null);
const obj = await client.file(square, "path", { source: 0, target: 120 }, "obj");
assert.match(await obj.text(), /^v /m);

// Problems
const problem = await client.path("0".repeat(64), 0, 1).catch((error: unknown) => error);
assert.ok(problem instanceof ProblemError);
assert.deepEqual([problem.status, problem.code], [404, "mesh_not_found"]);
const wrong = await client.path(square, 0, 999).catch((error: unknown) => error);
assert.ok(wrong instanceof ProblemError);
assert.equal(wrong.errors[0]?.pointer, "/target");

// A job has the same answer, tells its progress, and does not remain.
const asJobs = new GeodesicClient(url, {
  fetch: (address, init) => {
    const headers = new Headers(init?.headers);
    if (headers.has("Prefer")) headers.set("Prefer", "respond-async");
    return fetch(address, { ...init, headers });
  },
});
const shares: number[] = [];
const told = await asJobs.distances(square, 0, { onProgress: (share) => shares.push(share) });
assert.deepEqual(told.distances, field.distances);
assert.equal(shares.at(-1), 1);

// An abort stops work of minutes at the service: before it is a job, and after.
const large = await client.sample("knot", 20_000);
const sources = Array.from({ length: 1000 }, (_, i) => 9 * i);
const metric = async (name: string) =>
  Number(new RegExp(`^${name} (.+)$`, "m").exec(await (await fetch(`${url}/metrics`)).text())?.[1]);
const until = async (holds: () => Promise<boolean>) => {
  while (!(await holds())) await new Promise((resolve) => setTimeout(resolve, 20));
};
const isBusy = async () => (await metric('geodesic_workers{state="busy"}')) > 0;
for (const [number, other] of [client, asJobs].entries()) {
  const stop = new AbortController();
  const begun = Promise.withResolvers<void>();
  const onProgress = (share: number) => share > 0 && begun.resolve();
  const options = { targets: sources, signal: stop.signal, onProgress };
  const work = assert.rejects(other.matrix(large, sources, options), { name: "AbortError" });
  await Promise.race([other === asJobs ? begun.promise : until(isBusy), work]);
  stop.abort();
  await work;
  await until(async () => !(await isBusy()));
  assert.equal(await metric("geodesic_cancellations_total"), number + 1);
}
await until(async () => (await client.jobs()).jobs.length === 0);
console.log("all is well");

import { describe, expect, test, vi } from "vitest";
import { cutsOf, INITIAL, type State, Store, unitOf, withCut, withMesh } from "../src/state/state";
import { placesAt } from "./support/points";

test("a store begins with the initial state", () => {
  expect(new Store().state).toEqual(INITIAL);
});

test("an update changes what it names and nothing else", () => {
  const store = new Store();
  store.update({ mesh: "m", error: 0.1 });
  store.update({ places: placesAt({ vertex: 3 }) });

  expect(store.state).toEqual({
    ...INITIAL,
    mesh: "m",
    error: 0.1,
    places: placesAt({ vertex: 3 }),
  });
});

test("an update leaves the state before it as it was", () => {
  const store = new Store();
  const before = store.state;
  store.update({ wireframe: true });

  expect(store.state).not.toBe(before);
  expect(before.wireframe).toBe(false);
  expect(INITIAL.wireframe).toBe(false);
});

test("listeners are told the new state and the one before, in their order", () => {
  const store = new Store();
  const told: [string, State, State][] = [];
  for (const name of ["first", "second"]) {
    store.listen((state, before) => told.push([name, state, before]));
  }
  const before = store.state;
  store.update({ method: "approximate" });

  const { state } = store;
  expect(told).toEqual([
    ["first", state, before],
    ["second", state, before],
  ]);
  expect(state.method).toBe("approximate");
});

test("a listener that updates is told of its own update too", () => {
  const store = new Store();
  const listener = vi.fn((state: State) => {
    if (state.maxDistance === null) store.update({ maxDistance: 1 });
  });
  store.listen(listener);
  store.update({ mesh: "m" });

  expect(store.state).toEqual({ ...INITIAL, mesh: "m", maxDistance: 1 });
  expect(listener).toHaveBeenCalledTimes(2);
});

test("a new mesh takes along the settings and none of the points", () => {
  const store = new Store();
  store.update({
    mesh: "old",
    places: placesAt({ vertex: 1 }, { vertex: 2 }, { vertex: 3 }),
    starts: 2,
    barriers: [[4]],
    maxDistance: 5,
    view: [0, 1, 2, 0, 0, 0],
    method: "approximate",
    error: 0.1,
    shade: "territories",
    lines: null,
    wireframe: true,
  });
  store.update(withMesh("new", store.state));

  expect(store.state).toEqual({
    ...INITIAL,
    mesh: "new",
    method: "approximate",
    error: 0.1,
    shade: "territories",
    lines: null,
    wireframe: true,
  });
});

test("a distance between isolines belongs to a mesh, their number does not", () => {
  const spaced = withMesh("new", { ...INITIAL, lines: { spacing: 0.5 }, unit: "mm" });
  expect(spaced).toMatchObject({ lines: INITIAL.lines, unit: "" });
  expect(withMesh("new", { ...INITIAL, lines: { count: 7 } }).lines).toEqual({ count: 7 });
  expect(withMesh("new", { ...INITIAL, lines: null }).lines).toBeNull();
});

test("a cut is taken back with what was set before, and what was chosen since stays", () => {
  const store = new Store();
  const view = [0, 1, 2, 0, 0, 0];
  store.update({ mesh: "whole", places: placesAt({ vertex: 1 }, { vertex: 2 }), unit: "mm" });
  store.update({ lines: { spacing: 0.5 }, view, up: "y" });
  const whole = store.state;
  store.update(withCut("halves", ["path"], whole));
  expect(store.state).toEqual({
    ...INITIAL,
    ...{ mesh: "halves", cut: store.state.cut, boundary: true, unit: "mm", view, up: "y" },
  });
  const halves = store.state;
  store.update({ places: placesAt({ vertex: 7 }), palette: "magma" });
  store.update(withCut("quarters", ["walk", "isolines"], store.state));
  store.update({ barriers: [[3]] });

  const [first, second] = cutsOf(store.state);
  expect([first?.along, second?.along]).toEqual([["path"], ["walk", "isolines"]]);
  store.update(second?.back ?? {});
  expect(store.state).toEqual({ ...halves, places: placesAt({ vertex: 7 }), palette: "magma" });
  store.undo();
  expect(store.state).toMatchObject({ mesh: "quarters", barriers: [[3]] });
  store.update(first?.back ?? {});
  expect(store.state).toEqual({ ...whole, palette: "magma" });
  expect(withMesh("another", halves).cut).toBeNull();
});

test("the camera of an unrolled surface is not that of the surface", () => {
  const view = [0, 1, 2, 0, 0, 0];
  const cut = withCut("m", ["path"], { ...INITIAL, view, unroll: true });
  expect(cut).toMatchObject({ view: null, unroll: false });
  expect(cut.cut?.back).toMatchObject({ view: null, unroll: true });
});

test("a unit without a name is that of the mesh", () => {
  expect(unitOf({ ...INITIAL, unit: "mm" })).toBe("mm");
  expect(unitOf(INITIAL)).toBe("mesh units");
});

test("what cannot be read is no question until there is another one", () => {
  const store = new Store();
  store.update({ isReadable: false });
  store.update({ wireframe: true, view: null });
  expect(store.state.isReadable).toBe(false);
  for (const change of [{ places: [] }, { starts: 1 }, { barriers: [[1]] }, { mesh: "m" }]) {
    store.update({ isReadable: false });
    store.update(change);
    expect(store.state.isReadable).toBe(true);
  }
});

describe("undo", () => {
  const paletteOf = (store: Store) => store.state.palette;

  test("goes back step by step, and forth again", () => {
    const store = new Store();
    const steps: State[] = [store.state];
    const changes = [
      { mesh: "m" },
      { places: placesAt({ vertex: 1 }) },
      { barriers: [[4]] },
      { palette: "magma" as const },
      { distances: false },
      { mesh: "other", places: [] },
    ];
    for (const change of changes) {
      store.update(change);
      steps.push(store.state);
    }
    for (const step of steps.toReversed().slice(1)) {
      store.undo();
      expect(store.state).toEqual(step);
    }
    expect(store.canUndo).toBe(false);
    store.undo();
    for (const step of steps.slice(1)) {
      store.redo();
      expect(store.state).toEqual(step);
    }
    expect(store.canRedo).toBe(false);
  });

  test("counts no step where nothing changes, nor what is not the user's", () => {
    const store = new Store();
    store.update({ palette: "teal" });
    store.replace({ palette: "magma" });
    expect(store.canUndo).toBe(false);
  });

  test("takes back a gesture at once", () => {
    const store = new Store();
    store.update({ palette: "magma" });
    store.beginGesture();
    for (let i = 1; i < 9; i++) store.update({ maxDistance: i });
    store.endGesture();
    expect(store.state.maxDistance).toBe(8);
    store.undo();
    expect(store.state.maxDistance).toBeNull();
    expect(paletteOf(store)).toBe("magma");
    store.redo();
    expect(store.state.maxDistance).toBe(8);
  });

  test("has nothing of a gesture that is abandoned", () => {
    const store = new Store();
    store.update({ palette: "magma" });
    store.beginGesture();
    store.update({ maxDistance: 3 });
    store.abandonGesture();
    expect(store.state.maxDistance).toBeNull();
    expect(store.canRedo).toBe(false);
    store.undo();
    expect(paletteOf(store)).toBe("teal");
  });

  test("leaves the camera alone, unless another mesh or another axis comes back", () => {
    const store = new Store();
    const view = [0, 1, 2, 0, 0, 0];
    store.update({ mesh: "m" });
    store.update({ barriers: [[4]] });
    store.replace({ view, up: "y" });
    store.undo();
    expect(store.state).toMatchObject({ barriers: [], view, up: "y" });
    store.update({ up: "z", view: null });
    store.undo();
    expect(store.state).toMatchObject({ up: "y", view });
    store.undo();
    expect(store.state).toMatchObject({ mesh: null, view: null });
  });

  test("forgets what was undone once something else is done", () => {
    const store = new Store();
    store.update({ palette: "magma" });
    store.undo();
    store.update({ palette: "turbo" });
    store.redo();
    expect(paletteOf(store)).toBe("turbo");
  });
});

// The list of what is set: points, each with its name, then the walk, the barriers and the cuts.
import { byId, count } from "../dom";
import { LONGEST_NAME } from "../state/permalink";
import { nameOf, reordered, without } from "../state/places";
import { sayPoint } from "../state/point";
import { cutsOf, type State, type Store } from "../state/state";
import { wordsOf } from "./cutting";

export class PlaceList {
  private readonly list = byId("places");

  constructor(private readonly store: Store) {}

  /** Show what is set; a list that is as before stays as it is. */
  show(state: State, before: State | null): void {
    const isOther = (["places", "starts", "walk", "barriers", "cut"] as const).some(
      (each) => state[each] !== before?.[each],
    );
    if (!isOther) return;
    const { places, walk, barriers } = state;
    const rows = places.map((_, i) => this.rowOf(state, i));
    if (walk) rows.push(this.extra("walk", "Straight on from A", { walk: null }));
    barriers.forEach((faces, i) => {
      const name = barriers.length > 1 ? `Barrier ${i + 1}` : "Barrier";
      const words = `${name} of ${count(faces.length, "face")}`;
      rows.push(this.extra("barrier", words, { barriers: barriers.toSpliced(i, 1) }));
    });
    byId("clear", HTMLButtonElement).disabled = rows.length === 0 && state.maxDistance === null;
    cutsOf(state).forEach((cut, i, { length }) => {
      const name = length > 1 ? `Cut ${i + 1}` : "Cut";
      rows.push(this.extra("cut", `${name} along ${wordsOf(cut)}`, cut.back));
    });
    this.list.replaceChildren(...rows);
    byId("nothing").hidden = rows.length > 0;
  }

  private rowOf(state: State, index: number): HTMLLIElement {
    const { places, starts } = state;
    const place = places[index];
    if (!place) throw new Error(`there is no place ${index}`);
    const name = nameOf(state, index);
    const kind = index < starts ? "start" : index === places.length - 1 ? "end" : "stop";
    const row = rowFor(kind, nameOf({ places: places.map(unnamed), starts }, index));
    const handle = iconButton("⠿", `Move ${name}: drag, or arrow up and down`, () => undefined);
    handle.className = "handle";
    handle.addEventListener("keydown", (event) => {
      const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      this.move(index, index + step);
    });
    handle.addEventListener("pointerdown", (event) => this.drag(row, index, event));
    const label = iconButton(
      place.name || sayPoint(place.point),
      `Rename ${name}`,
      ({ detail }) => {
        if (detail !== 1) this.rename(label, index); // by keyboard, or twice
      },
    );
    label.className = "name";
    label.title = "Double-click to rename";
    label.setAttribute("aria-label", `Rename ${name}, ${sayPoint(place.point)}`);
    row.prepend(handle);
    row.append(
      label,
      this.removal(name, index, () => without(this.store.state, index)),
    );
    return row;
  }

  private extra(kind: string, words: string, change: Partial<State>): HTMLLIElement {
    const row = rowFor(kind, "");
    const label = document.createElement("span");
    label.className = "name";
    label.textContent = words;
    row.append(
      label,
      this.removal(words, this.list.children.length, () => change),
    );
    return row;
  }

  private removal(what: string, index: number, change: () => Partial<State>): HTMLElement {
    const button = iconButton("×", `Remove ${what}`, () => {
      this.store.update(change());
      this.focus(index, ".remove");
    });
    button.className = "remove";
    return button;
  }

  private move(from: number, to: number): void {
    const { state } = this.store;
    if (to < 0 || to >= state.places.length || to === from) return;
    this.store.update(reordered(state, from, to));
    this.focus(to, ".handle");
  }

  /** Drag a row over others, and move it there in the end. */
  private drag(
    row: HTMLLIElement,
    from: number,
    { clientY, pointerId, target }: PointerEvent,
  ): void {
    const handle = target as HTMLElement;
    const rows = [...this.list.children].slice(0, this.store.state.places.length);
    const tops = rows.map((each) => each.getBoundingClientRect().top);
    const height = row.getBoundingClientRect().height;
    let to = from;
    const move = (event: PointerEvent): void => {
      const top = (tops[from] ?? 0) + event.clientY - clientY;
      to = tops.filter((each, i) => i !== from && each + height / 2 < top + height / 2).length;
      row.style.translate = `0 ${event.clientY - clientY}px`;
      rows.forEach((each, i) => {
        if (i === from) return;
        const aside = i > from && i <= to ? -1 : i < from && i >= to ? 1 : 0;
        (each as HTMLElement).style.translate = `0 ${aside * height}px`;
      });
    };
    const end = ({ type }: Event): void => {
      handle.removeEventListener("pointermove", move);
      this.list.classList.remove("sorting");
      for (const each of rows) (each as HTMLElement).style.translate = "";
      if (type === "pointerup") this.move(from, to);
    };
    handle.setPointerCapture(pointerId);
    this.list.classList.add("sorting");
    handle.addEventListener("pointermove", move);
    handle.addEventListener("pointerup", end, { once: true });
    handle.addEventListener("pointercancel", end, { once: true });
  }

  private rename(label: HTMLElement, index: number): void {
    const { places } = this.store.state;
    const field = document.createElement("input");
    field.type = "text";
    field.value = places[index]?.name ?? "";
    field.maxLength = LONGEST_NAME;
    field.placeholder = label.textContent ?? "";
    field.setAttribute("aria-label", label.getAttribute("aria-label") ?? "");
    let isOver = false;
    const end = (isTaken: boolean, focuses: boolean): void => {
      if (isOver) return;
      isOver = true;
      field.replaceWith(label);
      const name = field.value.trim().replaceAll(";", ","); // as it divides points in the address
      if (isTaken && name !== places[index]?.name) {
        this.store.update({
          places: places.map((place, i) => (i === index ? { ...place, name } : place)),
        });
      }
      if (focuses) this.focus(index, ".name");
    };
    field.addEventListener("blur", () => end(true, false));
    field.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" && event.key !== "Escape") return;
      event.stopPropagation();
      end(event.key === "Enter", true);
    });
    label.replaceWith(field);
    field.focus();
    field.select();
  }

  /** Focus a part of a row, or of the last one. */
  private focus(index: number, part: string): void {
    const row = this.list.children[Math.min(index, this.list.children.length - 1)];
    const element = row?.querySelector<HTMLElement>(part) ?? byId("canvas");
    element.focus();
  }
}

function unnamed<P extends { name: string }>(place: P): P {
  return { ...place, name: "" };
}

function rowFor(kind: string, letter: string): HTMLLIElement {
  const row = document.createElement("li");
  row.className = kind;
  const disc = document.createElement("span");
  disc.className = "disc";
  disc.textContent = letter;
  row.append(disc);
  return row;
}

function iconButton(
  text: string,
  label: string,
  onClick: (event: MouseEvent) => void,
): HTMLButtonElement {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  element.setAttribute("aria-label", label);
  element.addEventListener("click", onClick);
  return element;
}

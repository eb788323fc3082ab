// The names of points beside them on the screen; faint where the surface hides them.
import { Vector3 } from "three";
import { byId } from "../dom";
import type { Stage } from "./scene";
import type { Triple } from "./simplified";

interface Label {
  position: Triple;
  name: string;
}

export class Labels {
  private shown: { at: Vector3; element: HTMLElement }[] = [];
  private readonly place: HTMLElement;

  constructor(
    private readonly stage: Stage,
    id: string,
    private readonly isSeen: (position: Triple) => boolean,
  ) {
    this.place = byId(id);
  }

  show(labels: Label[]): void {
    this.shown = labels.map(({ position, name }) => {
      const element = document.createElement("span");
      element.textContent = name;
      return { at: new Vector3(...position), element };
    });
    this.place.replaceChildren(...this.shown.map(({ element }) => element));
  }

  /** Move the labels to where their points are drawn now. */
  follow(): void {
    const { left, top } = this.place.getBoundingClientRect();
    for (const { at, element } of this.shown) {
      const [x, y] = this.stage.toPage(at);
      element.style.translate = `${x - left}px ${y - top}px`;
      element.classList.toggle("hidden-point", !this.isSeen(at.toArray()));
    }
  }
}

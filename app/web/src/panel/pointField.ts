// A field for points: in words, and as coordinates while it is edited.
import type { Point } from "../api/types";
import { byId } from "../dom";
import { parsePoints, sayPoint, type WrittenPoint, writePoint } from "../state/point";

export class PointField {
  private readonly input: HTMLInputElement;
  private points: readonly Point[] = [];
  private written = "";
  /** Whether the text is the user's, and no point is known for it. */
  private isEdited = false;

  constructor(id: string) {
    this.input = byId(id, HTMLInputElement);
    this.input.addEventListener("focus", () => {
      this.input.value = this.written;
      this.input.select(); // the Tab key selected the words
    });
    this.input.addEventListener("input", () => {
      this.written = this.input.value;
      this.isEdited = true;
    });
    this.input.addEventListener("blur", () => {
      if (!this.isEdited) this.adopt();
    });
  }

  /** Read the points as they are written; throw where there is something else. */
  read(): WrittenPoint[] {
    return parsePoints(this.written);
  }

  /** Show points; what is being edited stays as it is. */
  show(points: readonly Point[]): void {
    this.points = points;
    this.isEdited = false;
    if (this.input !== document.activeElement) this.adopt();
  }

  private adopt(): void {
    this.written = this.points.map(writePoint).join(" ");
    this.input.value = this.points.map(sayPoint).join(", ");
  }
}

// Elements by id, and numbers as text for people.
export function byId(id: string): HTMLElement;
export function byId<T extends HTMLElement>(id: string, kind: new () => T): T;
export function byId(id: string, kind: new () => HTMLElement = HTMLElement): HTMLElement {
  return query(`#${id}`, kind);
}

/** Return the first element that a selector finds; it must be there, and of the right kind. */
export function query<T extends HTMLElement>(selector: string, kind: new () => T): T {
  const element = document.querySelector(selector);
  if (!(element instanceof kind)) throw new Error(`there is no ${kind.name} ${selector}`);
  return element;
}

/** Return a number as text, rounded to significant digits. */
export function written(x: number, digits = 5): string {
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e6 || size < 1e-4) return x.toExponential(digits - 1).replace(/\.?0+e/, "e");
  return Number(x.toPrecision(digits)).toLocaleString("en", { maximumSignificantDigits: digits });
}

/** Return a number and its noun: 1 face, 2 faces. */
export function count(x: number, noun: string, plural = `${noun}s`): string {
  return `${x.toLocaleString("en")} ${x === 1 ? noun : plural}`;
}

export function duration(seconds: number): string {
  return seconds < 1 ? `${Number((1000 * seconds).toPrecision(2))} ms` : `${seconds.toFixed(2)} s`;
}

export function button(text: string, onClick: () => void): HTMLButtonElement {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  element.addEventListener("click", onClick);
  return element;
}

/** Hand a file to the user. */
export function download(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

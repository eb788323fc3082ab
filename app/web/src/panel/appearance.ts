// Appearance: dark or light, the folded panel, the hint.
import { byId } from "../dom";

const THEME = "geodesic-theme";
const HINT = "geodesic-hint";
const TOLD_MS = 4000;

export function setUpAppearance(onTheme: () => void): void {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const apply = (): void => {
    const chosen = localStorage.getItem(THEME) ?? (dark.matches ? "dark" : "light");
    document.documentElement.dataset.theme = chosen;
    onTheme();
  };
  dark.addEventListener("change", apply);
  byId("theme").addEventListener("click", () => {
    localStorage.setItem(THEME, isDark() ? "light" : "dark");
    apply();
  });
  apply();
  byId("fold").addEventListener("click", () => setFolded(!byId("folded").hidden));
  foldOnPhone();
  byId("hint-close").addEventListener("click", dismissHint);
}

function setFolded(isFolded: boolean): void {
  byId("folded").hidden = isFolded;
  byId("fold").setAttribute("aria-expanded", String(!isFolded));
}

/** Fold the panel where it would lie over the mesh. */
export function foldOnPhone(): void {
  if (matchMedia("(max-width: 46rem)").matches) setFolded(true);
}

let telling = 0;

/** Tell in a few words what became of a click or a key: for a while, or until something changes. */
export function tell(words: string): void {
  clearTimeout(telling);
  byId("told").textContent = words;
  if (words) telling = setTimeout(() => tell(""), TOLD_MS);
}

export function isDark(): boolean {
  return document.documentElement.dataset.theme === "dark";
}

export function showHint(): void {
  byId("hint").hidden = localStorage.getItem(HINT) !== null;
}

export function dismissHint(): void {
  byId("hint").hidden = true;
  localStorage.setItem(HINT, "seen");
}

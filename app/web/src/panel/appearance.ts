// Appearance: dark or light, the folded panel, the hint.
import { byId } from "../dom";

const THEME = "geodesic-theme";
const HINT = "geodesic-hint";

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
  const fold = byId("fold");
  const setFolded = (isFolded: boolean): void => {
    byId("folded").hidden = isFolded;
    fold.setAttribute("aria-expanded", String(!isFolded));
  };
  fold.addEventListener("click", () => setFolded(!byId("folded").hidden));
  setFolded(matchMedia("(max-width: 46rem)").matches);
  byId("hint-close").addEventListener("click", dismissHint);
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

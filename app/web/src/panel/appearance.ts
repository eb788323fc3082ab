// Appearance: dark or light, the folded panel.
import { byId } from "../dom";

const THEME = "geodesic-theme";

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
}

export function setFolded(isFolded: boolean): void {
  byId("folded").hidden = isFolded;
  byId("fold").setAttribute("aria-expanded", String(!isFolded));
}

/** Fold the panel where it would lie over the mesh. */
export function foldOnPhone(): void {
  if (matchMedia("(max-width: 46rem)").matches) setFolded(true);
}

export function isDark(): boolean {
  return document.documentElement.dataset.theme === "dark";
}
